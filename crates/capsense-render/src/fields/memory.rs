//! Graphics memory: reserving it, and reading it back.

use crate::adapter::Adapter;
use crate::error::RenderError;
use std::time::Duration;

/// A frame that takes longer than this counts as a driver that hangs.
const FRAME_TIMEOUT: Duration = Duration::from_secs(120);

/// Waits for all that was submitted and takes a buffer's values.
pub(super) fn read(
    adapter: &Adapter,
    buffer: &wgpu::Buffer,
    doing: &'static str,
) -> Result<Vec<f32>, RenderError> {
    let failed = |reason: String| RenderError::Driver { doing, reason };
    // Whether mapping succeeded is told by `get_mapped_range`.
    buffer.map_async(wgpu::MapMode::Read, .., |_| {});
    let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(FRAME_TIMEOUT) };
    adapter.device.poll(wait).map_err(|error| failed(error.to_string()))?;
    adapter.faults.check(doing)?;
    let bytes = buffer.slice(..).get_mapped_range().map_err(|error| failed(error.to_string()))?;
    let values = bytemuck::try_cast_slice(&bytes).map_err(|error| failed(error.to_string()))?.to_vec();
    drop(bytes);
    buffer.unmap();
    Ok(values)
}

/// Reserves graphics memory.
pub(super) struct Reserve<'a> {
    pub(super) adapter: &'a Adapter,
}

impl Reserve<'_> {
    /// A buffer of so many bytes.
    ///
    /// # Errors
    /// When they exceed the adapter's limits or its memory.
    pub(super) fn buffer(
        &self,
        label: &'static str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, RenderError> {
        let Adapter { device, limits, .. } = self.adapter;
        let limit = match usage.contains(wgpu::BufferUsages::STORAGE) {
            true => limits.max_buffer_size.min(limits.max_storage_buffer_binding_size),
            false => limits.max_buffer_size,
        };
        if size > limit {
            return Err(RenderError::LimitExceeded { what: label, needed: size, limit });
        }
        let scope = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        let buffer = device.create_buffer(&descriptor);
        match pollster::block_on(scope.pop()) {
            Some(_) => Err(RenderError::OutOfMemory { what: label, needed: size }),
            None => Ok(buffer),
        }
    }
}
