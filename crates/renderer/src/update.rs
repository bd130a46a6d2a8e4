//! The next frame of a scene: only what changed is updated.
//!
//! ```text
//! scene -> keys of its meshes -> changed BVHs: refit or rebuild (policy) -> top level: refit or rebuild
//! ```

use std::ops::AddAssign;
use std::time::{Duration, Instant};

use canted_scene::{Instance, Scene};
use canted_trace::InstanceId;
use rayon::prelude::*;

use crate::bottom_level::Triangles;
use crate::scene_bvh::{
    FlatBvh, MeshKey, SceneLevels, flatten_distinct, instances, level_choice, mirrors, triangle_shares, unused_features,
};
use crate::update_policy::{BvhCosts, UpdatePolicy};
use crate::{BottomLevel, PrepareError, SceneBvh, SceneBvhConfig, coincident};

/// How to update.
#[derive(Clone, Copy, Debug, Default)]
pub struct UpdateOptions {
    /// For BVHs whose triangles have moved.
    pub policy: UpdatePolicy,
    /// Time that the rays of the last frame took, by which [`UpdatePolicy::Auto`] weighs slower rays against a rebuild.
    pub trace_time: Duration,
}

/// What one or more updates did. Every update counts each bottom-level BVH once, and the top level once if there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Updates {
    /// BVHs over triangles that stayed as they were.
    pub unchanged: usize,
    /// BVHs over triangles that were refitted, and not rebuilt after that.
    pub refits: usize,
    /// BVHs over triangles that were rebuilt.
    pub rebuilds: usize,
    /// Updates after which the top level stayed as it was.
    pub top_unchanged: usize,
    /// Refits of the top level.
    pub top_refits: usize,
    /// Rebuilds of the top level.
    pub top_rebuilds: usize,
    /// Updates that prepared the whole scene again: another number of meshes, other levels, or an earlier failure.
    pub whole: usize,
    /// Greatest drift of a BVH that was refitted: [`canted_wide::Refit::drift`].
    pub max_drift: f32,
    /// Time of all updates.
    pub time: Duration,
    /// Time of refits of BVHs over triangles.
    pub refit_time: Duration,
    /// Time of rebuilds of BVHs over triangles.
    pub rebuild_time: Duration,
}

impl AddAssign for Updates {
    fn add_assign(&mut self, other: Self) {
        self.unchanged += other.unchanged;
        self.refits += other.refits;
        self.rebuilds += other.rebuilds;
        self.top_unchanged += other.top_unchanged;
        self.top_refits += other.top_refits;
        self.top_rebuilds += other.top_rebuilds;
        self.whole += other.whole;
        self.max_drift = self.max_drift.max(other.max_drift);
        self.time += other.time;
        self.refit_time += other.refit_time;
        self.rebuild_time += other.rebuild_time;
    }
}

impl SceneBvh {
    /// Updates to another state of the scene: usually the next frame. Hits are then those of [`SceneBvh::build`] for it, bit for bit.
    ///
    /// Meshes, instances and levels are compared with those of the last call. A mesh whose vertices moved is refitted or rebuilt, one
    /// with other triangles is rebuilt, and the others keep their BVH. The top level is updated where instances or their meshes
    /// changed. In one level, the BVH over all instances is refitted or rebuilt.
    ///
    /// ```
    /// use canted_renderer::{Levels, SceneBvh, SceneBvhConfig, UpdateOptions};
    ///
    /// let mut scene = canted_scene::builtin();
    /// let config = SceneBvhConfig { levels: Levels::Two, ..SceneBvhConfig::default() };
    /// let mut bvh = SceneBvh::build(&scene, &config)?;
    /// scene.instances[0].world_from_object.columns[3][1] += 0.5;
    /// let updates = bvh.update(&scene, &UpdateOptions::default())?;
    /// assert_eq!((updates.unchanged, updates.top_refits), (scene.meshes.len(), 1), "only the top level");
    /// # Ok::<(), canted_renderer::PrepareError>(())
    /// ```
    ///
    /// # Errors
    /// As [`SceneBvh::build`]. The structure may then be a mixture of both states; the next update builds it again.
    pub fn update(&mut self, scene: &Scene, options: &UpdateOptions) -> Result<Updates, PrepareError> {
        let start = Instant::now();
        let keys: Vec<MeshKey> = scene.meshes.par_iter().map(|mesh| MeshKey::of(scene, mesh)).collect();
        let was_stale = std::mem::replace(&mut self.history.is_stale, true);
        let changed = if was_stale { None } else { self.update_levels(scene, &keys, options).ok().flatten() };
        let mut updates = match changed {
            Some(updates) => {
                self.unused = unused_features(&self.levels, &self.choice, scene, &self.history.config);
                updates
            }
            None => {
                *self = Self::build(scene, &self.history.config)?;
                let n_top = usize::from(matches!(self.levels, SceneLevels::Two(_)));
                Updates { rebuilds: self.levels.bottom().len(), top_rebuilds: n_top, whole: 1, ..Updates::default() }
            }
        };
        let history = &mut self.history;
        history.meshes = keys;
        history.instances.clone_from(&scene.instances);
        history.is_stale = false;
        updates.time = start.elapsed();
        self.build_time = updates.time;
        if updates.whole > 0 {
            updates.rebuild_time = updates.time;
        }
        Ok(updates)
    }

    /// Updates both levels, or the only one; `None` where the scene must be prepared again.
    fn update_levels(
        &mut self,
        scene: &Scene,
        keys: &[MeshKey],
        options: &UpdateOptions,
    ) -> Result<Option<Updates>, PrepareError> {
        let Self { levels, choice, history, .. } = self;
        if keys.len() != history.meshes.len() {
            return Ok(None);
        }
        let changed: Vec<usize> = (0..keys.len()).filter(|&i| keys[i] != history.meshes[i]).collect();
        if !changed.is_empty() || scene.instances != history.instances {
            *choice = level_choice(scene, &history.config)?;
        }
        if choice.is_one != matches!(levels, SceneLevels::One(_)) {
            return Ok(None);
        }
        let mut update = BvhUpdate { config: history.config, options, updates: Updates::default() };
        match levels {
            SceneLevels::One(flat) => {
                if changed.is_empty() && scene.instances == history.instances {
                    update.updates.unchanged = 1;
                } else {
                    let same = |i: &Instance| (i.mesh, keys[i.mesh.0 as usize].triangles);
                    let before = |i: &Instance| (i.mesh, history.meshes[i.mesh.0 as usize].triangles);
                    let may_refit = scene.instances.iter().map(same).eq(history.instances.iter().map(before));
                    let (positions, triangles, first) = flatten_distinct(scene)?;
                    let FlatBvh { bvh, first: old_first, mirrors: old_mirrors } = flat;
                    let triangles =
                        Triangles { positions: &positions, close: None, triangles: &triangles, curves: None };
                    update.apply(bvh, &mut history.costs[0], triangles, may_refit, 1.0)?;
                    (*old_first, *old_mirrors) = (first, mirrors(scene));
                }
            }
            SceneLevels::Two(tlas) => {
                let n_placed = |mesh: usize| scene.instances.iter().filter(|i| i.mesh.0 as usize == mesh).count();
                let shares = if changed.is_empty() { Vec::new() } else { triangle_shares(scene, n_placed) };
                update.updates.unchanged = keys.len() - changed.len();
                let mut edit = tlas.edit();
                for &i in &changed {
                    let (mesh, costs) = (&scene.meshes[i], &mut history.costs[i]);
                    let may_refit = keys[i].triangles == history.meshes[i].triangles;
                    let triangles = coincident::of_mesh(scene, mesh);
                    let triangles = Triangles::of(mesh, &triangles);
                    edit.update_blas(i as u32, |bvh| update.apply(bvh, costs, triangles, may_refit, shares[i]))??;
                }
                let new = instances(scene);
                let is_same_number = scene.instances.len() == history.instances.len();
                let both = scene.instances.iter().zip(&history.instances);
                let moved: Vec<_> = (0_u32..)
                    .zip(both.zip(&new))
                    .filter(|(_, ((now, before), _))| now != before)
                    .map(|(i, (_, &new))| (InstanceId(i), new))
                    .collect();
                if is_same_number {
                    edit.set_each(&moved)?;
                }
                let updates = &mut update.updates;
                if !is_same_number {
                    drop(edit);
                    tlas.set_instances(&new)?;
                    updates.top_rebuilds = 1;
                } else if moved.is_empty() && changed.is_empty() {
                    updates.top_unchanged = 1;
                } else if options.policy == UpdatePolicy::Rebuild {
                    edit.rebuild();
                    updates.top_rebuilds = 1;
                } else {
                    edit.refit();
                    if options.policy == UpdatePolicy::Auto && tlas.rebuild_advised() {
                        tlas.rebuild();
                        updates.top_rebuilds = 1;
                    } else {
                        updates.top_refits = 1;
                    }
                }
            }
        }
        Ok(Some(update.updates))
    }
}

/// Updates of BVHs over triangles.
struct BvhUpdate<'a> {
    config: SceneBvhConfig,
    options: &'a UpdateOptions,
    updates: Updates,
}

impl BvhUpdate<'_> {
    /// Refits or rebuilds a BVH through which a fraction `share` of all rays go.
    fn apply(
        &mut self,
        bvh: &mut BottomLevel,
        costs: &mut BvhCosts,
        triangles: Triangles,
        may_refit: bool,
        share: f64,
    ) -> Result<(), PrepareError> {
        let UpdateOptions { policy, trace_time } = *self.options;
        let trace = share * trace_time.as_secs_f64();
        let refits = may_refit
            && match policy {
                UpdatePolicy::Refit => true,
                UpdatePolicy::Rebuild => false,
                UpdatePolicy::Auto => !costs.predicts_rebuild(trace),
            };
        let mut start = Instant::now();
        if refits && let Some(drift) = bvh.refit(triangles)? {
            let time = start.elapsed();
            self.updates.refit_time += time;
            self.updates.max_drift = self.updates.max_drift.max(drift);
            let is_old = costs.refitted_in(time.as_secs_f64(), drift.into());
            if policy == UpdatePolicy::Refit || !is_old {
                self.updates.refits += 1;
                return Ok(());
            }
            start = Instant::now();
        }
        *bvh = self.config.build(triangles)?;
        let time = start.elapsed();
        self.updates.rebuild_time += time;
        self.updates.rebuilds += 1;
        match may_refit {
            true => costs.rebuilt_in(time.as_secs_f64()),
            false => costs.replaced_in(time.as_secs_f64()),
        }
        Ok(())
    }
}
