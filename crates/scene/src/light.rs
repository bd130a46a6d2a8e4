/// A light that is no triangle. World space; all colours linear RGB.
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
    /// Light from one point into a cone.
    Spot {
        /// Where it is.
        position: [f32; 3],
        /// Unit direction of the axis.
        direction: [f32; 3],
        /// Radiant intensity along the axis, W/sr.
        intensity: [f32; 3],
        /// Cosine of the angle to the axis up to which the intensity is full.
        cos_inner: f32,
        /// Cosine of the angle beyond which there is no light; below `cos_inner`. Between both the intensity is
        /// `intensity · ((cosθ - cos_outer) / (cos_inner - cos_outer))²`, as `KHR_lights_punctual` proposes.
        cos_outer: f32,
    },
    /// A ball that shines outward. Rays see it.
    Sphere {
        /// Its middle.
        center: [f32; 3],
        /// Above zero.
        radius: f32,
        /// Emitted radiance, W/(m²·sr).
        radiance: [f32; 3],
    },
    /// A flat disc that shines to one side. Rays see it; from behind it is black.
    Disk {
        /// Its middle.
        center: [f32; 3],
        /// Unit normal of the side that shines.
        normal: [f32; 3],
        /// Above zero.
        radius: f32,
        /// Emitted radiance, W/(m²·sr).
        radiance: [f32; 3],
    },
}
