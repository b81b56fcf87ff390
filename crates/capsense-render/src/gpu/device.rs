//! The graphics device and its two pipelines.

use super::GpuOptions;
use crate::error::RenderError;
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes of a vertex: three floats.
const VERTEX_BYTES: u64 = 12;

/// Three rows of an affine map, in which the shader finds them.
pub(super) type Rows = [[f32; 4]; 3];

/// What the driver complained about outside of any call's result.
#[derive(Clone, Debug, Default)]
pub(super) struct Faults(Arc<Mutex<Option<String>>>);

impl Faults {
    fn record(&self, fault: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(fault);
    }

    /// Fails if the driver has complained since the last call.
    pub(super) fn check(&self, doing: &'static str) -> Result<(), RenderError> {
        match self.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(reason) => Err(RenderError::Driver { doing, reason }),
            None => Ok(()),
        }
    }
}

/// An open device with everything that does not depend on the scene.
#[derive(Debug)]
pub(super) struct GpuDevice {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) limits: wgpu::Limits,
    pub(super) faults: Faults,
    /// Keeps what is nearest; starts at depth 1.
    pub(super) front: wgpu::RenderPipeline,
    /// Keeps what is farthest; starts at depth 0.
    pub(super) back: wgpu::RenderPipeline,
    pub(super) description: String,
    pub(super) software: bool,
}

impl GpuDevice {
    /// Opens the fastest adapter: a discrete GPU, else an integrated one, else a software one if allowed.
    pub(super) fn open(options: &GpuOptions) -> Result<Self, RenderError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        // OpenGL, which another crate of the program may have compiled into wgpu, cannot copy depth to a buffer.
        descriptor.backends &= wgpu::Backends::PRIMARY;
        let instance = wgpu::Instance::new(descriptor);
        let wanted = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&wanted))
            .map_err(|error| RenderError::NoAdapter(error.to_string()))?;
        let info = adapter.get_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let description = describe(&info);
        if software && !options.allow_software {
            return Err(RenderError::OnlySoftwareAdapter(description));
        }
        let copies = wgpu::DownlevelFlags::DEPTH_TEXTURE_AND_BUFFER_COPIES;
        if !adapter.get_downlevel_capabilities().flags.contains(copies) {
            let reason = "it cannot copy depth to a buffer".to_owned();
            return Err(RenderError::Device { adapter: description, reason });
        }
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("capsense depth"),
            required_limits: limits.clone(),
            ..Default::default()
        }))
        .map_err(|error| RenderError::Device { adapter: description.clone(), reason: error.to_string() })?;

        let faults = Faults::default();
        let (uncaptured, lost) = (faults.clone(), faults.clone());
        device.on_uncaptured_error(Arc::new(move |error| uncaptured.record(error.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                lost.record(format!("device lost: {message}"));
            }
        });
        let front = pipeline(&device, "front", wgpu::CompareFunction::Less);
        let back = pipeline(&device, "back", wgpu::CompareFunction::Greater);
        faults.check("building the depth pipelines")?;
        Ok(Self { device, queue, limits, faults, front, back, description, software })
    }
}

fn describe(info: &wgpu::AdapterInfo) -> String {
    match (info.driver.as_str(), info.driver_info.as_str()) {
        ("", _) => info.name.clone(),
        (driver, "") => format!("{} ({driver})", info.name),
        (driver, details) => format!("{} ({driver} {details})", info.name),
    }
}

fn pipeline(device: &wgpu::Device, label: &str, keep: wgpu::CompareFunction) -> wgpu::RenderPipeline {
    let shader = device.create_shader_module(wgpu::include_wgsl!("../depth.wgsl"));
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[],
        immediate_size: 0,
    });
    let per_vertex = wgpu::VertexBufferLayout {
        array_stride: VERTEX_BYTES,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3],
    };
    let per_object = wgpu::VertexBufferLayout {
        array_stride: size_of::<Rows>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &wgpu::vertex_attr_array![1 => Float32x4, 2 => Float32x4, 3 => Float32x4],
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &shader,
            entry_point: Some("project"),
            compilation_options: Default::default(),
            buffers: &[Some(per_vertex), Some(per_object)],
        },
        // No culling: meshes from files may be wound either way.
        primitive: wgpu::PrimitiveState { cull_mode: None, ..Default::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(keep),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: None,
        multiview_mask: None,
        cache: None,
    })
}
