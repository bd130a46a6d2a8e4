//! Compares two pictures of the same samples.
//!
//! A device's rounding moves a path slightly; if that crosses an edge, the path hits something else and the sample is different. So
//! most pixels agree up to rounding and some diverge. Divergence favors neither side: either picture could have taken the other
//! path. For numbers `d` with random signs, `|Σd|` exceeds `x·√Σd²` with a probability of at most `2·exp(-x²/2)` (Hoeffding 1963),
//! whatever their sizes. Sums over the picture and over each block must satisfy that bound, so a bias that is small relative to
//! each pixel's noise adds up and is detected.

use std::sync::atomic::AtomicBool;

use canted_film::Film;
use canted_gpu::Gpu;
use canted_renderer::{DevicePicture, Levels, Monitor, SceneBvh, SceneBvhConfig, Settings, Surfaces, frame, render};
use canted_scene::{Camera, Scene};

/// Relative difference of a pixel, above a floor of a twentieth of white, that rounding explains: ten bounces of 30 roundings of
/// 2⁻²³ each are `2⁻¹⁵`; texture lookups with f32 coordinates may have eight times that.
const ROUNDING: f64 = 1.0 / 4096.0;

/// Bound of `|Σd|/√Σd²`, exceeded by chance once in 10⁷ sums.
const DRIFT: f64 = 6.0;

/// Side of a block in pixels.
const BLOCK: usize = 8;

/// Differences between pictures that should be equal.
#[derive(Debug)]
pub(super) struct Difference {
    /// Share of pixels that differ by more than [`ROUNDING`].
    pub(super) astray: f64,
    /// Relative difference of the means.
    pub(super) of_means: f64,
    /// `|Σd|/√Σd²` over diverging pixels: of all of them, and of the worst block.
    pub(super) drift: [f64; 2],
}

impl Difference {
    /// Fails if more than a share of the pixels diverges, the means differ by more than `of_means`, or the divergence is biased.
    #[track_caller]
    pub(super) fn check(&self, name: &str, [astray, of_means]: [f64; 2]) {
        let is_fair = self.drift.iter().all(|&drift| drift <= DRIFT);
        assert!(self.astray <= astray && self.of_means <= of_means && is_fair, "{name}: {self:?}");
    }
}

pub(super) fn scene_bvh(scene: &Scene, levels: Levels) -> SceneBvh {
    SceneBvh::build(scene, &SceneBvhConfig { levels, ..SceneBvhConfig::default() }).unwrap()
}

/// The scene's camera, or one that shows all of it.
pub(super) fn frame_of(scene: &Scene) -> Camera {
    let bvh = scene_bvh(scene, Levels::Auto);
    scene.cameras.first().copied().unwrap_or_else(|| frame(scene, &bvh, 64.0 / 36.0))
}

pub(super) fn on_device(gpu: &Gpu, scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Film {
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let picture = DevicePicture::new(gpu, &surfaces, bvh, camera, settings).unwrap();
    let monitor = Monitor { progress: &|_, _| (), finished: &|_| (), cancel: &AtomicBool::new(false) };
    picture.render(vec![], &monitor).unwrap()
}

pub(super) fn on_cpu(scene: &Scene, bvh: &SceneBvh, camera: &Camera, settings: &Settings) -> Film {
    render(scene, &bvh, camera, settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
}

/// Renders the scene on both devices and compares.
pub(super) fn compared(gpu: &Gpu, scene: &Scene, camera: &Camera, levels: Levels, settings: &Settings) -> Difference {
    let bvh = scene_bvh(scene, levels);
    let ours = on_device(gpu, scene, &bvh, camera, settings);
    difference(&ours, &on_cpu(scene, &bvh, camera, settings))
}

pub(super) fn difference(ours: &Film, theirs: &Film) -> Difference {
    let width = theirs.width() as usize;
    let columns = width.div_ceil(BLOCK);
    let n_blocks = columns * (theirs.height() as usize).div_ceil(BLOCK);
    let (mut n_astray, mut sums) = (0_u32, [0.0; 2]);
    let (mut all, mut blocks) = (Drift::default(), vec![Drift::default(); n_blocks]);
    for (index, (a, b)) in ours.pixels().iter().zip(theirs.pixels()).enumerate() {
        assert_eq!(a.n_taken(), b.n_taken());
        let (a, b) = (a.mean(), b.mean());
        if (0..3).any(|k| (a[k] - b[k]).abs() > ROUNDING * (b[k].abs() + 0.05)) {
            n_astray += 1;
            let apart = a.iter().sum::<f64>() - b.iter().sum::<f64>();
            all.add(apart);
            blocks[index / width / BLOCK * columns + index % width / BLOCK].add(apart);
        }
        sums[0] += a.iter().sum::<f64>();
        sums[1] += b.iter().sum::<f64>();
    }
    let n = theirs.pixels().len() as f64;
    Difference {
        astray: f64::from(n_astray) / n,
        of_means: (sums[0] / sums[1] - 1.0).abs(),
        drift: [all.value(), blocks.iter().map(Drift::value).fold(0.0, f64::max)],
    }
}

#[derive(Clone, Default)]
struct Drift {
    sum: f64,
    squares: f64,
}

impl Drift {
    fn add(&mut self, apart: f64) {
        self.sum += apart;
        self.squares += apart * apart;
    }

    fn value(&self) -> f64 {
        if self.squares > 0.0 { self.sum.abs() / self.squares.sqrt() } else { 0.0 }
    }
}
