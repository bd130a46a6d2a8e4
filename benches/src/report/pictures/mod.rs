//! Pictures: how error falls with time, for integrators, samplers, footprints of textures, devices and structures.
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
    chapter.tell(says);
    chapter.method = METHOD.map(str::to_owned).to_vec();
    Ok(chapter)
}

const METHOD: [&str; 4] = [
    "Every method renders the same view at doubling numbers of samples, once for each of several seeds, in turn: seed by seed, \
     number by number, method by method, after a warm-up. A point's bars reach over the seeds. Seconds are those that the \
     processor spent on all threads, which a busy neighbour hardly lengthens, except where devices are compared. What a render spends \
     whatever its samples, its set-up, is where the line through seconds over samples begins (medians of the seeds, weighed by \
     1/seconds²); it is counted with the build.",
    "Errors are against a reference of the same integrator (the hybrid one is biased, and its bias is not what is asked here) made \
     by another sampler with seeds of its own, as the mean of several pictures. Their differences tell the reference's own error, \
     which is subtracted from every error shown; the tables say how large a share of the smallest it was.",
    "relMSE is the mean of (a - b)²/(b² + 0.01) over channels and pixels; FLIP that of Andersson et al. 2020 at 67 pixels a degree. \
     Efficiency is 1/(MSE x seconds) at the most samples, its interval that of 95 in 100 resamplings of the seeds, which of few \
     seeds, as between devices in a quick run, tells little. Behind an exponent ± is its standard error.",
    "Structures answer the same rays with the same hits: that all pictures are equal bit for bit is checked, so structures differ \
     in time alone, and a dearer build pays from the number of samples on at which the lines cross. A sample's seconds are the difference \
     between a picture of many samples and one of one, over their number; crossings are found round by round, and stand with the \
     interval of their median.",
];
