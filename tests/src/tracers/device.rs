//! A device, with the CPU as fallback for traversals that a driver ends early.

use std::{cell::Cell, rc::Rc};

use canted_gpu::{DeviceHit, Gpu, HIT_ERROR, Outcome, SceneInput, TracedScene};
use canted_obb::PrimId;
use canted_tlas::Instance;
use canted_trace::{Hit, InstanceId, Ray, Side};
use canted_wide::Config;

use super::{Guarantee, Make, Method, Tracer, TwoLevels, wide};
use crate::closed::baked;

/// The device with one level and with two.
pub(super) fn methods(gpu: &Rc<Gpu>) -> [Method; 2] {
    let cuts: [Rc<Cell<usize>>; 2] = Default::default();
    let [(of_one, cuts_of_one), (of_two, cuts_of_two)] = cuts.each_ref().map(|cuts| (Rc::clone(gpu), Rc::clone(cuts)));
    let one: Make = Box::new(move |mesh, placement| {
        let tree = wide(&baked(mesh, placement), &Config::default());
        let scene = TracedScene::new(&of_one, SceneInput::upload([&tree])).expect("small meshes fit every device");
        Box::new(Device { gpu: Rc::clone(&of_one), scene, tree: Box::new(tree), n_cut: Rc::clone(&cuts_of_one) })
    });
    let two: Make = Box::new(move |mesh, placement| {
        let tree = wide(mesh, &Config::default());
        let scene = TracedScene::new(&of_two, SceneInput::upload([&tree]).instances(&[Instance::new(0, *placement)]));
        let scene = scene.expect("transforms in tests are well conditioned");
        let tree = Box::new(TwoLevels::new(tree, mesh, placement));
        Box::new(Device { gpu: Rc::clone(&of_two), scene, tree, n_cut: Rc::clone(&cuts_of_two) })
    });
    let [cuts_of_one, cuts_of_two] = cuts;
    // Static instances double the error bound of hits (`HitError::with` in `canted-gpu`).
    [
        Method { n_cut: cuts_of_one, ..Method::new("device", Guarantee::Device(HIT_ERROR), one) },
        Method { n_cut: cuts_of_two, ..Method::new("two-level device", Guarantee::Device(2.0 * HIT_ERROR), two) },
    ]
}

/// A scene on the device, and on the CPU for traversals that a driver ends early.
struct Device {
    gpu: Rc<Gpu>,
    scene: TracedScene,
    tree: Box<dyn Tracer>,
    n_cut: Rc<Cell<usize>>,
}

impl Device {
    /// The CPU's answer instead of the device's.
    fn cut<T>(&self, ask: impl FnOnce(&dyn Tracer) -> T) -> T {
        self.n_cut.update(|n| n + 1);
        ask(self.tree.as_ref())
    }
}

impl Tracer for Device {
    fn closest(&self, rays: &[Ray]) -> Vec<Option<Hit>> {
        let answers = self.scene.closest_hits(&self.gpu, rays).expect("the device is not lost");
        let known = |(answer, ray): (Outcome<Option<DeviceHit>>, &Ray)| match answer {
            Outcome::Incomplete => self.cut(|tree| tree.closest(std::slice::from_ref(ray))[0]),
            Outcome::Complete(hit) => hit.map(|hit| Hit {
                t: hit.t,
                u: hit.u,
                v: hit.v,
                primitive: PrimId(hit.primitive),
                instance: InstanceId(hit.instance),
                side: Side::Front,
            }),
        };
        answers.into_iter().zip(rays).map(known).collect()
    }

    fn occluded(&self, rays: &[Ray]) -> Vec<bool> {
        let answers = self.scene.occluded(&self.gpu, rays).expect("the device is not lost");
        let known = |(answer, ray): (Outcome<bool>, &Ray)| match answer {
            Outcome::Incomplete => self.cut(|tree| tree.occluded(std::slice::from_ref(ray))[0]),
            Outcome::Complete(found) => found,
        };
        answers.into_iter().zip(rays).map(known).collect()
    }
}
