//! Packs camera and settings.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use bytemuck::{Pod, Zeroable};
use canted_film::Filter;
use canted_gpu::{Variant, choice};

use super::DeviceError;
use crate::narrow;
use crate::{Pattern, Sampler, Settings, View};

/// Pixels of a cell, and invocations of a work-group.
pub(super) const CELL_PIXELS: usize = 64;

/// Stratified samples per pixel that kernels count in 32 bits.
const MAX_STRATIFIED: u32 = 1 << 20;

/// `Picture` of `shared/picture`, where the members are documented.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct PackedPicture {
    pub(super) eye: [f32; 3],
    pub(super) pixel: f32,
    pub(super) forward: [f32; 3],
    pub(super) lens_radius: f32,
    pub(super) right: [f32; 3],
    pub(super) focus_distance: f32,
    pub(super) down: [f32; 3],
    pub(super) filter_radius: f32,
    pub(super) size: [u32; 2],
    pub(super) bounces: u32,
    pub(super) inverse_ao_radius: f32,
    pub(super) sampler: [u32; 4],
    pub(super) ambient: [f32; 3],
    pub(super) slack: f32,
    pub(super) background: [f32; 3],
    pub(super) has_background: u32,
    pub(super) limit: f32,
    pub(super) ground: u32,
    pub(super) padding: [f32; 2],
}

/// `Slice` of `shared/picture`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Slice {
    pub(super) first_group: u32,
    pub(super) end_group: u32,
    pub(super) first_sample: u32,
    pub(super) n_samples: u32,
    pub(super) first_cell: u32,
}

/// All members except those that depend on the scene.
pub(super) fn picture(view: &View, settings: &Settings, ao_radius: f64) -> PackedPicture {
    /// Stands for infinity.
    const FAR: f32 = 3e38;
    let Settings { width, height, samples, bounces, seed, pattern, clamp, .. } = *settings;
    let [columns, rows] = Sampler::new(pattern, samples, seed).grid();
    let lens = view.lens;
    PackedPicture {
        eye: narrow(view.eye),
        pixel: view.right.length() as f32,
        forward: narrow(view.forward),
        lens_radius: lens.map_or(0.0, |lens| lens.radius),
        right: narrow(view.right),
        focus_distance: lens.map_or(0.0, |lens| lens.focus_distance),
        down: narrow(view.down),
        filter_radius: settings.filter.radius(),
        size: [width, height],
        bounces,
        // Clamped: at such radii any distance counts as unoccluded.
        inverse_ao_radius: (1.0 / ao_radius).min(1e30) as f32,
        sampler: [seed, columns, rows, columns.saturating_mul(rows)],
        ambient: [0.0; 3],
        slack: 0.0,
        background: [0.0; 3],
        has_background: 0,
        limit: clamp.map_or(FAR, |clamp| clamp.min(FAR)),
        ground: u32::MAX,
        padding: [0.0; 2],
    }
}

/// What pictures of a scene took so far, from which the next one sizes its dispatches. No sample depends on it.
#[derive(Default)]
pub(super) struct Pace {
    /// Work-groups of the next dispatch, and most rounds that samples needed; 0 if not known.
    n_groups: AtomicU32,
    n_rounds: AtomicU32,
    /// Whether a software driver takes as many samples at once as hardware.
    is_of_hardware: AtomicBool,
}

impl Pace {
    pub(super) fn n_groups(&self) -> u32 {
        self.n_groups.load(Ordering::Relaxed)
    }

    pub(super) fn set_groups(&self, n: u32) {
        self.n_groups.store(n, Ordering::Relaxed);
    }

    pub(super) fn is_of_hardware(&self) -> bool {
        self.is_of_hardware.load(Ordering::Relaxed)
    }

    /// Expects the times of fast hardware from now on, to test what it does.
    pub(super) fn expect_hardware(&self) {
        self.is_of_hardware.store(true, Ordering::Relaxed);
        self.set_groups(u32::MAX);
    }

    pub(super) fn n_rounds(&self) -> Option<u32> {
        Some(self.n_rounds.load(Ordering::Relaxed)).filter(|&n| n > 0)
    }

    /// Notes the rounds that some samples needed: the most of them, which later ones forget one by one.
    pub(super) fn took_rounds(&self, n: u32) {
        self.n_rounds.store(n.max(self.n_rounds.load(Ordering::Relaxed).saturating_sub(1)), Ordering::Relaxed);
    }
}

/// Selects the parts of a kernel that generate camera rays.
pub(super) fn specialize(chosen: Variant, view: &View, settings: &Settings) -> Variant {
    let pattern = match settings.pattern {
        Pattern::Random => choice::Pattern::Random,
        Pattern::Stratified => choice::Pattern::Stratified,
        Pattern::Sobol => choice::Pattern::Sobol,
    };
    let projection = if view.is_perspective { choice::View::Perspective } else { choice::View::Orthographic };
    let lens = if view.lens.is_some() { choice::Lens::Disk } else { choice::Lens::Pinhole };
    let is_box = matches!(settings.filter, Filter::Box(_));
    chosen.with(pattern).with(projection).with(lens).with(if is_box {
        choice::Filter::Box
    } else {
        choice::Filter::Table
    })
}

/// Rejects settings that the kernels do not support.
pub(super) fn check_supported(settings: &Settings) -> Result<(), DeviceError> {
    if settings.pattern == Pattern::Stratified && settings.samples > MAX_STRATIFIED {
        return Err(DeviceError::Unsupported { what: "more than 1048576 stratified samples per pixel" });
    }
    Ok(())
}
