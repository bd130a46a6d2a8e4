//! Pictures: error over time of integrators, samplers, texture footprints, devices and structures.
//!
//! Source: Celarek et al., Quantifying the Error of Light Transport Algorithms, 2019, for errors of many short renders.

mod devices;
mod footprints;
mod methods;
mod race;
mod reference;
mod stage;
mod structures;

use anyhow::Result;

use super::effort::Effort;
use super::model::Chapter;

/// Measures the chapter.
pub(super) fn chapter(effort: Effort) -> Result<Chapter> {
    let mut chapter = Chapter { id: "pictures", title: "Pictures: error over time", ..Chapter::default() };
    let mut says = vec![];
    for stage in stage::stages(effort, &mut chapter.skipped)? {
        says.push(methods::add(&mut chapter, &stage, effort)?);
        if stage.is_first {
            says.push(structures::add(&mut chapter, &stage, effort)?);
            says.extend(devices::add(&mut chapter, &stage, effort)?);
        }
    }
    says.push(footprints::add(&mut chapter, effort)?);
    chapter.set_sentences(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 4] = [
    "Every method renders the same view at doubling sample counts, once per seed, in turn: seed by seed, count by count, method by \
     method, after a warm-up. A point's bars cover the seeds. Times are processor seconds of all threads, except for the comparison \
     of devices. The set-up, which does not depend on the number of samples, is the intercept of the line through seconds over \
     samples (medians of the seeds, weighted by 1/seconds²); it is counted with the build.",
    "Errors are relative to a reference of the same integrator (the bias of `hybrid` is not measured here): the mean of several \
     pictures of another sampler with other seeds. The differences between those pictures give the reference's own error, which is \
     subtracted from every error; the tables show its share of the smallest error.",
    "relMSE is the mean of (a - b)²/(b² + 0.01) over channels and pixels; FLIP is that of Andersson et al. 2020 at 67 pixels per degree. \
     Efficiency is 1/(MSE x seconds) at the largest sample count, with the interval of 95 in 100 resamplings of the seeds, which is \
     unreliable for few seeds, as for devices in a quick run. ± after an exponent is its standard error.",
    "All structures give the same hits: the pictures are checked to be equal bit for bit, so structures differ only in time, and a \
     more expensive build pays off from the number of samples at which the lines cross. The time per sample is the difference \
     between pictures of many samples and of one, divided by the number of samples; crossings are computed per round and shown with \
     the interval of their median.",
];
