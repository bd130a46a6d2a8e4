/// A light that no ray can hit by chance. World space; all colours linear RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Parallel light.
    Sun {
        /// Unit direction in which the light travels.
        direction: [f32; 3],
        /// Irradiance on a surface that faces it, W/m².
        irradiance: [f32; 3],
    },
    /// Light from one point.
    Point {
        /// Where it is.
        position: [f32; 3],
        /// Radiant intensity, W/sr.
        intensity: [f32; 3],
    },
}
