//! Pictures in memory, with the options of `canted render`.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Result, anyhow};
use canted_film::{Aovs, Film};
use canted_renderer::{Monitor, Surfaces, resume_with};
use canted_scene::{Scene, SceneFile};
use clap::{Args as _, Command, FromArgMatches as _};

use crate::{
    load, options, output,
    render::{self, Setup},
    settings::{self, LookOptions, PictureArgs, Plan, Purpose},
};

/// A rendered picture.
#[derive(Debug)]
pub struct Picture {
    /// Sums of samples.
    pub film: Film,
    /// The additional channels that were asked for.
    pub aovs: Aovs,
    /// What the program would have written to standard error, one sentence each.
    pub warnings: Vec<String>,
}

/// Where a scene comes from.
#[derive(Clone, Debug)]
pub enum Source<'a> {
    /// The built-in scene.
    Builtin,
    /// Any file that `canted render` reads.
    File(&'a Path),
    /// A scene file in memory.
    SceneFile(&'a SceneFile),
}

/// Renders on the CPU in the caller's thread pool: the film of `canted render` with the same options and `--device cpu`, bit for bit.
///
/// `options` are those of `canted render` that determine a picture, and `aovs`: the long name without dashes in front, with `_`
/// or `-` between words, and the value. An option that may be repeated on the command line may be repeated here. Nothing is
/// printed.
///
/// # Errors
/// One sentence: an unknown option, an invalid value, a file that cannot be read, or a cancelled render.
pub fn picture(source: &Source<'_>, options: &[(String, String)], monitor: &Monitor<'_>) -> Result<Picture> {
    picture_part(source, options, None, monitor)
}

/// As [`picture()`], of the samples from the first to one before the last of `part` alone: the film is then a part, which
/// [`canted_film::Part::join`] joins with others.
///
/// # Errors
/// As [`picture()`]; samples beyond those of the picture.
pub fn picture_part(
    source: &Source<'_>,
    options: &[(String, String)],
    part: Option<[u32; 2]>,
    monitor: &Monitor<'_>,
) -> Result<Picture> {
    let (rendered, warnings) = output::collecting(|| film(source, options, part, monitor));
    let (film, aovs) = rendered?;
    Ok(Picture { film, aovs, warnings })
}

/// Options of a picture in memory besides those of every picture.
#[derive(clap::Args, Clone, Debug, Default)]
struct Channels {
    /// Additional channels.
    #[arg(long, value_parser = render::aov, value_delimiter = ',')]
    aovs: Vec<Aovs>,
    /// The rectangle that is rendered, in pixels of the whole picture; the film is of this rectangle.
    #[arg(long, value_parser = render::crop, value_name = "X,Y,W,H")]
    crop: Option<[u32; 4]>,
}

fn film(
    source: &Source<'_>,
    options: &[(String, String)],
    part: Option<[u32; 2]>,
    monitor: &Monitor<'_>,
) -> Result<(Film, Aovs)> {
    let path = if let Source::File(path) = source { Some(*path) } else { None };
    let read = settings::scene_file(path)?;
    let scene_file = if let Source::SceneFile(file) = source { Some(*file) } else { read.as_ref() };
    // A film is linear: exposure and tone curve belong to the formats of files.
    let of_files = options::names::<LookOptions>();
    let args: PictureArgs<Channels> = parse(path, options, |name| !of_files.iter().any(|other| other == name))?;
    let aovs = render::union(&args.own.aovs);
    let factor = render::factor(&args.own.aovs);
    let purpose = Purpose { part, aovs, factor, is_linear: true, shows_data: !aovs.is_empty(), ..Purpose::default() };
    let crop = args.own.crop;
    let plan = args.resolve(scene_file, &purpose)?;
    if let Some(crop) = crop {
        render::check_crop(crop, plan.size())?;
        if part.is_some() {
            return Err(anyhow!("a part and crop cannot be used together"));
        }
    }
    let mut scene = match source {
        Source::SceneFile(file) => {
            let mut scene = file.load()?;
            load::report(&mut scene);
            scene
        }
        _ => load::scene(path, &plan.source.read_options(plan.source.time()))?,
    };
    render(&mut scene, plan, crop, monitor)
}

fn render(scene: &mut Scene, mut plan: Plan, crop: Option<[u32; 4]>, monitor: &Monitor<'_>) -> Result<(Film, Aovs)> {
    let source = plan.apply_light(scene)?;
    let Setup { bvh, camera, .. } = render::setup(scene, &mut plan, source)?;
    let settings = &plan.settings;
    let surfaces = Surfaces::with_lod(scene, settings.lod);
    let done = crop.map_or(vec![], |crop| render::tiles_outside(crop, settings));
    let film = resume_with(&surfaces, &bvh, &camera, settings, done, monitor)?;
    if let Some(warning) = render::dropped_samples(&film) {
        output::warn(&warning);
    }
    let film = match crop {
        Some([x, y, width, height]) => film.cropped([x, y], [width, height]),
        None => film,
    };
    Ok((film, settings.aovs))
}

/// Options by name: the long name without dashes in front, with `_` or `-` between words. `is_option` says which of those of `R` there are.
///
/// # Errors
/// One sentence: an unknown option, or an invalid value.
pub(crate) fn parse<R: clap::Args>(
    scene: Option<&Path>,
    options: &[(String, String)],
    is_option: impl Fn(&str) -> bool,
) -> Result<PictureArgs<R>> {
    let known: Vec<String> = options::names::<PictureArgs<R>>();
    let known: Vec<&str> =
        known.iter().map(|name| &name[..]).filter(|name| *name != "scene" && is_option(name)).collect();
    let mut words = vec![OsString::from("render")];
    for (name, value) in options {
        words.push(format!("{}={value}", options::flag(&options::known_name(name, &known)?)).into());
    }
    words.extend(scene.map(|path| [OsString::from("--"), path.into()]).into_iter().flatten());
    let command = PictureArgs::<R>::augment_args(Command::new("render")).disable_help_flag(true);
    let found = command.args_override_self(true).try_get_matches_from(words);
    let args = found.and_then(|matches| PictureArgs::from_arg_matches(&matches));
    args.map_err(|error| anyhow!("{}", sentence(&error)))
}

/// The error of a command line on one line, without advice about the program.
fn sentence(error: &clap::Error) -> String {
    let text = error.to_string();
    let lines =
        text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"));
    let line = lines.filter(|line| !line.is_empty() && !line.starts_with("tip:")).collect::<Vec<_>>().join(" ");
    line.strip_prefix("error: ").unwrap_or(&line).to_owned()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    fn rendered(options: &[(&str, &str)]) -> Result<Picture> {
        let options: Vec<(String, String)> = options.iter().map(|&(a, b)| (a.to_owned(), b.to_owned())).collect();
        let cancel = AtomicBool::new(false);
        picture(&Source::Builtin, &options, &Monitor::quiet(&cancel))
    }

    #[test]
    fn options_are_those_of_the_program() {
        let small = [("size", "6x4"), ("spp", "1")];
        let film = rendered(&small).unwrap().film;
        assert_eq!((film.width(), film.height(), film.n_samples()), (6, 4, 24));
        assert_ne!(rendered(&[small[0], small[1], ("seed", "7")]).unwrap().film.pixels(), film.pixels());
        let with_aovs = rendered(&[small[0], small[1], ("aovs", "depth,normal")]).unwrap();
        assert_eq!((with_aovs.aovs.iter().count(), with_aovs.film.guides().len()), (2, 24));
        let rows = rendered(&[small[0], small[1], ("crop", "1,2,4,2")]).unwrap().film;
        assert_eq!(rows.pixels(), film.cropped([1, 2], [4, 2]).pixels());
        let error = rendered(&[small[0], ("crop", "1,2,6,2")]).unwrap_err().to_string();
        assert_eq!(error, "--crop 1,2,6,2 exceeds the picture of 6 x 4 pixels");
        let suns = [("sun", "0,-1,0,1,1,1"), ("sun", "-1,-1,0,1,1,1")];
        let lit = |suns: &[(&str, &str)]| rendered(&[&small[..], suns].concat()).unwrap().film.pixels().to_vec();
        assert!(lit(&suns) != lit(&suns[..1]) && lit(&suns) != lit(&suns[1..]), "each of a repeated option counts");
    }

    #[test]
    fn errors_are_sentences() {
        let error = |name: &str, value: &str| rendered(&[(name, value)]).unwrap_err().to_string();
        assert_eq!(error("spq", "1"), "unknown option 'spq'; did you mean 'spp'?");
        assert!(error("output", "a.png").starts_with("unknown option 'output'"));
        assert!(error("threads", "1").starts_with("unknown option 'threads'"));
        let of_value = error("spp", "none");
        assert!(of_value.starts_with("invalid value 'none' for '--spp <N>'") && !of_value.contains('\n'), "{of_value}");
        let of_name = error("integrator", "pth");
        assert!(of_name.contains("[possible values: hybrid, path]") && !of_name.contains("help"), "{of_name}");
        assert_eq!(
            error("ao_radius", "0"),
            "invalid value '0' for '--ao-radius <LENGTH>': '0' is not a length greater than zero"
        );
    }
}
