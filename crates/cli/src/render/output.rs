//! The file of a picture: the part that is shown, denoised and exposed, with boxes over it.

use std::{borrow::Cow, path::PathBuf};

use anyhow::{Result, anyhow};
use canted_film::{
    Aov, Aovs, Film, Format, Partial, Picture, Record, Tile,
    denoise::{Denoise, Noisy, REACH, denoise},
    encode, is_own_png, write_film_as,
};
use canted_obb::Obb;
use canted_renderer::{BoxLevel, SceneBvh, View, draw_boxes};
use canted_scene::Camera;

use crate::{output, settings::LookOptions};

/// Where a picture is written, and as what.
#[derive(Clone, Debug)]
pub(super) struct OutputFile {
    pub(super) path: PathBuf,
    pub(super) format: Format,
    /// Whether the output is standard output.
    pub(super) is_stream: bool,
    /// Whether a file that another program wrote stays.
    pub(super) keeps_others: bool,
    /// The part that is shown: left, top, width and height.
    pub(super) crop: Option<[u32; 4]>,
    /// The size of the whole picture.
    pub(super) size: [u32; 2],
    /// Additional channels.
    pub(super) aovs: Aovs,
    pub(super) denoising: Denoising,
    /// Whether what the camera sees behind the scene is transparent.
    pub(super) is_transparent: bool,
    pub(super) look: LookOptions,
}

/// Whether a picture is denoised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Denoising {
    Off,
    /// Only what a picture that is stopped has with a single sample per pixel.
    IfStopped,
    /// If it has fewer than [`FEW_SAMPLES`] samples per pixel, which a time limit may decide.
    OfFewSamples,
    On,
}

impl Denoising {
    /// Its name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            // Of a finished picture.
            Self::Off | Self::IfStopped => "off",
            Self::OfFewSamples => "for few samples",
            Self::On => "on",
        }
    }
}

/// The channels that guide the filter.
pub(super) const GUIDES: [Aov; 3] = [Aov::Albedo, Aov::ShadingNormal, Aov::Depth];

/// Pictures with fewer samples per pixel are denoised without an option.
pub(super) const FEW_SAMPLES: u32 = 64;

/// A rendered picture or film.
pub(super) enum Output {
    Picture(Picture),
    /// A film, and its denoised picture.
    Film(Box<Film>, Record, Option<Picture>),
}

impl OutputFile {
    /// The size of the output.
    pub(super) fn shown_size(&self) -> [u32; 2] {
        self.crop.map_or(self.size, |[.., width, height]| [width, height])
    }

    /// Fails if the file cannot be written, or must stay. Returns whether there is one that is replaced.
    pub(super) fn probe(&self) -> Result<bool> {
        if self.is_stream {
            return Ok(false);
        }
        output::probe(&self.path)?;
        let exists = self.path.exists();
        if exists && self.keeps_others && !is_own_png(&self.path) {
            let name = self.path.display();
            return Err(anyhow!(
                "{name} is not a picture that canted wrote; use -o for another name, or --force to replace it"
            ));
        }
        Ok(exists)
    }

    /// Rejects a crop that exceeds the picture.
    pub(super) fn check_crop(&self) -> Result<()> {
        self.crop.map_or(Ok(()), |crop| check_crop(crop, self.size))
    }

    /// Empty tiles for all that a crop does not show and the filter does not read, so that they are not rendered.
    pub(super) fn outside(&self, settings: &canted_renderer::Settings) -> Vec<Tile> {
        let Some(crop) = self.crop else { return Vec::new() };
        let needed = match self.denoising {
            Denoising::Off | Denoising::IfStopped => crop,
            Denoising::OfFewSamples | Denoising::On => with_margin(crop, self.size),
        };
        tiles_outside(needed, settings)
    }

    /// Writes what was rendered.
    pub(super) fn write(&self, output: Output, overlay: Option<&Overlay>) -> Result<()> {
        match output {
            Output::Film(film, record, denoised) => self.write_film(*film, denoised, &record, overlay),
            // A heat map is a diagram: its colors are not exposed.
            Output::Picture(picture) => self.write_encoded(picture, None, overlay),
        }
    }

    /// Writes a film as it is so far.
    pub(super) fn write_unfinished(&self, film: Film) -> Result<()> {
        let denoised = self.denoised(&film)?;
        self.write_film(film, denoised, &Record::new(), None)
    }

    /// Writes the tiles of a picture that were added, or the picture that is made of them.
    pub(super) fn write_partial(&self, partial: &Partial, made: Option<Picture>) -> Result<()> {
        let shown = |picture: &Picture| match self.crop {
            Some([x, y, width, height]) => picture.cropped([x, y], [width, height]),
            None => picture.clone(),
        };
        match (partial.film(), made) {
            (Some(film), None) => self.write_unfinished(film),
            (Some(film), Some(made)) => self.write_film(film, Some(shown(&made)), &Record::new(), None),
            (None, made) => self.write_picture(shown(made.as_ref().unwrap_or(partial.picture())), None, None),
        }
    }

    /// The denoised picture of a film, if it is to be denoised.
    pub(super) fn denoised(&self, film: &Film) -> Result<Option<Picture>> {
        let is_denoised = match self.denoising {
            Denoising::Off | Denoising::IfStopped => false,
            Denoising::OfFewSamples => film.pixels().iter().all(|pixel| pixel.n_taken() < FEW_SAMPLES),
            Denoising::On => true,
        };
        is_denoised.then(|| denoised(film, self.crop)).transpose()
    }

    /// Writes the part of a film that is shown, or its denoised picture, and the requested channels.
    ///
    /// Takes the film, so that its memory is free before the file is encoded.
    fn write_film(
        &self,
        film: Film,
        denoised: Option<Picture>,
        record: &Record,
        overlay: Option<&Overlay>,
    ) -> Result<()> {
        let film = if self.crop.is_some() { self.cropped(&film).into_owned() } else { film };
        let alpha = self.is_transparent.then(|| film.alpha());
        if film.part().is_some() || !self.aovs.is_empty() {
            let mut picture = covering(denoised.unwrap_or_else(|| film.picture()), alpha.as_deref());
            self.draw(&mut picture, overlay);
            return Ok(write_film_as(&self.path, &picture, alpha.as_deref(), &film, self.aovs, record)?);
        }
        self.write_picture(denoised.unwrap_or_else(|| film.into_picture()), alpha.as_deref(), overlay)
    }

    /// Writes a picture with the look of the options.
    fn write_picture(&self, picture: Picture, alpha: Option<&[f32]>, overlay: Option<&Overlay>) -> Result<()> {
        let picture = covering(picture, alpha);
        let picture = if self.format.is_linear() { picture } else { self.look.apply(picture) };
        self.write_encoded(picture, alpha, overlay)
    }

    fn write_encoded(&self, mut picture: Picture, alpha: Option<&[f32]>, overlay: Option<&Overlay>) -> Result<()> {
        self.draw(&mut picture, overlay);
        if self.is_stream {
            let bytes = encode(&picture, alpha, self.format);
            return output::bytes_to_stdout(
                &bytes.map_err(|reason| anyhow!("cannot write standard output: {reason}"))?,
            );
        }
        Ok(canted_film::write_picture(&self.path, &picture, alpha, self.format)?)
    }

    /// The part of a film that is shown.
    pub(super) fn cropped<'a>(&self, film: &'a Film) -> Cow<'a, Film> {
        let crop = |[x, y, width, height]: [u32; 4]| Cow::Owned(film.cropped([x, y], [width, height]));
        self.crop.map_or(Cow::Borrowed(film), crop)
    }

    /// Draws boxes over the part of a picture that is shown.
    fn draw(&self, picture: &mut Picture, overlay: Option<&Overlay>) {
        if let Some(Overlay { view, boxes }) = overlay {
            draw_boxes(picture, self.crop.map_or([0, 0], |[left, top, ..]| [left, top]), view, boxes);
        }
    }
}

/// The colors of what covers each pixel of a picture that is black where nothing does.
fn covering(mut picture: Picture, alpha: Option<&[f32]>) -> Picture {
    for (color, &alpha) in picture.pixels.iter_mut().zip(alpha.unwrap_or_default()) {
        // A denoised picture may be bright where nothing was hit.
        *color = if alpha > 0.0 { color.map(|x| x / alpha) } else { [0.0; 3] };
    }
    picture
}

/// Boxes that are drawn over a picture.
pub(super) struct Overlay {
    view: View,
    boxes: Vec<Obb>,
}

impl Overlay {
    /// The boxes of a level. Warns about a level without boxes.
    pub(super) fn new(level: BoxLevel, bvh: &SceneBvh, camera: &Camera, [width, height]: [u32; 2]) -> Result<Self> {
        let boxes = bvh.boxes(level);
        if boxes.is_empty() {
            output::warn(&no_boxes(level, bvh.n_levels()));
        }
        Ok(Self { view: View::new(camera, width, height)?, boxes })
    }
}

/// The warning about a level without boxes.
pub(crate) fn no_boxes(level: BoxLevel, n_levels: u32) -> String {
    match n_levels {
        0 => format!("--boxes {level} shows nothing: the scene has no triangles"),
        n => format!("--boxes {level} shows nothing: the structure has the levels 0 to {}", n - 1),
    }
}

/// Rejects a rectangle that exceeds a picture.
pub(crate) fn check_crop([left, top, width, height]: [u32; 4], size: [u32; 2]) -> Result<()> {
    let ends = [u64::from(left) + u64::from(width), u64::from(top) + u64::from(height)];
    if ends[0] <= size[0].into() && ends[1] <= size[1].into() {
        return Ok(());
    }
    let [w, h] = size;
    Err(anyhow!("--crop {left},{top},{width},{height} exceeds the picture of {w} x {h} pixels"))
}

/// Empty tiles for all that does not overlap a rectangle, so that they are not rendered.
pub(crate) fn tiles_outside([left, top, width, height]: [u32; 4], settings: &canted_renderer::Settings) -> Vec<Tile> {
    let tiling = settings.tiling();
    let overlaps = |number: usize| {
        let ([x, y], [columns, rows]) = (tiling.corner(number), tiling.size(number));
        x < left + width && left < x + columns && y < top + height && top < y + rows
    };
    (0..tiling.n_tiles()).filter(|&number| !overlaps(number)).map(|number| tiling.tile(number)).collect()
}

/// The rectangle that must be rendered so that the filtered picture in `crop` is that of the whole picture.
fn with_margin([left, top, width, height]: [u32; 4], size: [u32; 2]) -> [u32; 4] {
    let along = |first: u32, n: u32, n_all: u32| {
        let start = first.saturating_sub(REACH);
        (start, (first + n).saturating_add(REACH).min(n_all) - start)
    };
    let ((left, width), (top, height)) = (along(left, width, size[0]), along(top, height, size[1]));
    [left, top, width, height]
}

/// The filtered picture of a film with guides, or the part of it in `crop`.
///
/// # Errors
/// A film without guides.
pub(crate) fn denoised(film: &Film, crop: Option<[u32; 4]>) -> Result<Picture> {
    let noisy =
        Noisy::of_film(film).ok_or_else(|| anyhow!("the film has no albedo, normal and depth to guide the filter"))?;
    let config = Denoise::default();
    let Some(crop) = crop else { return Ok(denoise(noisy, &config)) };
    let [left, top, width, height] = with_margin(crop, [film.width(), film.height()]);
    let picture = denoise(noisy.cropped([left, top], [width, height]), &config);
    Ok(picture.cropped([crop[0] - left, crop[1] - top], [crop[2], crop[3]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_end_at_the_borders() {
        assert_eq!(with_margin([0, 0, 4, 4], [1000, 1000]), [0, 0, 4 + REACH, 4 + REACH]);
        let [left, top, width, height] = with_margin([500, 10, 4, 4], [1000, 20]);
        assert_eq!([left, width], [500 - REACH, 4 + 2 * REACH]);
        assert_eq!([top, height], [0, 20]);
    }
}
