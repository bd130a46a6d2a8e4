//! Exposure and tone curve of pictures in formats that are not linear.

use std::str::FromStr;

use canted_film::{Picture, ToneMap};

use crate::{
    options::{self, one_of},
    output,
};

/// Options about the look of a picture.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Look (formats of 8 and 16 bits; .exr and .hdr stay linear)")]
pub(crate) struct LookArgs {
    /// Exposure in stops, each of which doubles the brightness, or `auto` for a mean of middle gray [default: 0]
    #[arg(long, value_name = "EV|auto", allow_hyphen_values = true)]
    exposure: Option<Exposure>,
    /// Tone curve: `none` clamps, `filmic-neutral` (Khronos PBR Neutral) keeps the colors of glTF materials, `agx` and `aces` are
    /// those of films.
    #[arg(long, default_value = "none", value_parser = one_of(&TONE_MAPS), value_name = "CURVE")]
    tone_map: ToneMap,
}

const TONE_MAPS: [(&str, ToneMap); 4] = [
    ("none", ToneMap::None),
    ("agx", ToneMap::Agx),
    ("aces", ToneMap::Aces),
    ("filmic-neutral", ToneMap::FilmicNeutral),
];

/// The value of `--exposure`.
#[derive(Clone, Copy, Debug)]
enum Exposure {
    Auto,
    Stops(f32),
}

impl FromStr for Exposure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        /// More stops than between the darkest and the brightest `f32`.
        const LIMIT: f32 = 200.0;
        if text == "auto" {
            return Ok(Self::Auto);
        }
        match options::number(text) {
            Ok(stops) if stops.abs() <= LIMIT => Ok(Self::Stops(stops)),
            _ => Err(format!("'{text}' is neither auto nor a number of stops from -{LIMIT} to {LIMIT}")),
        }
    }
}

impl LookArgs {
    /// Whether no exposure is given.
    pub(super) fn is_unset(&self) -> bool {
        self.exposure.is_none()
    }

    /// The number of stops, unless it depends on the picture.
    pub(crate) fn stops(&self) -> Option<f32> {
        match self.exposure {
            Some(Exposure::Stops(stops)) => Some(stops),
            _ => None,
        }
    }

    /// Exposes by a number of stops; `None` for no given exposure.
    pub(crate) fn set_stops(&mut self, stops: Option<f32>) {
        self.exposure = stops.map(Exposure::Stops);
    }

    /// Warns about options without effect on a linear format.
    pub(super) fn warn_ignored(&self, is_linear: bool) {
        if is_linear && (self.exposure.is_some() || self.tone_map != ToneMap::None) {
            output::warn("--exposure and --tone-map have no effect on linear formats");
        }
    }

    /// The picture as it is encoded.
    pub(crate) fn apply(&self, picture: Picture) -> Picture {
        let stops = match self.exposure {
            None => 0.0,
            Some(Exposure::Stops(stops)) => stops,
            Some(Exposure::Auto) => {
                let stops = picture.auto_exposure();
                output::note(&format!("--exposure auto: {stops:+.2}"));
                stops
            }
        };
        let exposed = if stops == 0.0 { picture } else { picture.exposed(stops) };
        if self.tone_map == ToneMap::None { exposed } else { exposed.tone_mapped(self.tone_map) }
    }
}
