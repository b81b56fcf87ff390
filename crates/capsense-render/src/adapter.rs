//! Opening a graphics adapter, and what its driver complains about.

use crate::error::RenderError;
use std::sync::{Arc, Mutex, PoisonError};

/// What the driver complained about outside of any call's result.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faults(Arc<Mutex<Option<String>>>);

impl Faults {
    fn record(&self, fault: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(fault);
    }

    /// Fails if the driver has complained since the last call.
    pub(crate) fn check(&self, doing: &'static str) -> Result<(), RenderError> {
        match self.0.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(reason) => Err(RenderError::Driver { doing, reason }),
            None => Ok(()),
        }
    }
}

/// An open device; copies are of the same one.
#[derive(Clone, Debug)]
pub(crate) struct Adapter {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) limits: wgpu::Limits,
    pub(crate) faults: Faults,
    /// Name of the adapter and its driver.
    pub(crate) description: String,
    /// Whether it runs on the processor.
    pub(crate) software: bool,
}

impl Adapter {
    /// Opens the fastest adapter: a discrete GPU, else an integrated one, else a software one if allowed. `needs` are the
    /// capabilities without which it is refused, and what they are for.
    ///
    /// # Errors
    /// When there is none, or it cannot be opened or lacks what is needed.
    pub(crate) fn open(
        label: &'static str,
        allow_software: bool,
        needs: (wgpu::DownlevelFlags, &'static str),
    ) -> Result<Self, RenderError> {
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
        if software && !allow_software {
            return Err(RenderError::OnlySoftwareAdapter(description));
        }
        let (flags, what_for) = needs;
        if !adapter.get_downlevel_capabilities().flags.contains(flags) {
            return Err(RenderError::Device { adapter: description, reason: what_for.to_owned() });
        }
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some(label),
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
        Ok(Self { device, queue, limits, faults, description, software })
    }
}

fn describe(info: &wgpu::AdapterInfo) -> String {
    match (info.driver.as_str(), info.driver_info.as_str()) {
        ("", _) => info.name.clone(),
        (driver, "") => format!("{} ({driver})", info.name),
        (driver, details) => format!("{} ({driver} {details})", info.name),
    }
}
