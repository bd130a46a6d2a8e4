//! Meshes of entities as instances of one `Tlas`, which follows their transforms.
//!
//! ```text
//! Collider, GlobalTransform -> instances inserted, moved, removed -> Contacts of the frame;  ray -> entity
//! ```
//! Each change costs a few microseconds, however many entities there are, and contacts are looked for only around what moved.

use std::collections::HashMap;
use std::sync::Arc;

use bevy_app::{App, Last, Plugin};
use bevy_ecs::prelude::*;
use bevy_transform::prelude::GlobalTransform;
use canted::collide::Contacts;
use canted::{Affine, Instance, InstanceId, Intersect, Ray, Tlas, TriangleBvh};

/// An entity with a mesh, by its index in [`CollisionScene`].
#[derive(Component, Clone, Copy)]
pub(crate) struct Collider(pub(crate) u32);

/// Keeps a [`CollisionScene`] of these meshes up to date, at the end of each frame.
pub(crate) struct CollisionPlugin {
    pub(crate) meshes: Vec<Arc<TriangleBvh>>,
}

impl Plugin for CollisionPlugin {
    fn build(&self, app: &mut App) {
        let tlas = Tlas::new(self.meshes.clone(), &[], Default::default()).expect("no instance is too many");
        app.insert_resource(CollisionScene {
            contacts: Contacts::new(&tlas),
            tlas,
            instances: HashMap::new(),
            entities: vec![],
            begun: vec![],
            ended: vec![],
        });
        app.add_systems(Last, follow);
    }
}

/// All entities with a [`Collider`], as instances.
#[derive(Resource)]
pub(crate) struct CollisionScene {
    tlas: Tlas<Arc<TriangleBvh>>,
    contacts: Contacts,
    instances: HashMap<Entity, InstanceId>,
    /// Of each instance, by number.
    entities: Vec<Entity>,
    /// Entities that began to touch in the last frame, the lower one first.
    pub(crate) begun: Vec<[Entity; 2]>,
    /// Entities that ceased to touch in the last frame, the lower one first.
    pub(crate) ended: Vec<[Entity; 2]>,
}

impl CollisionScene {
    /// The first entity along a ray, and where the ray hits it, in units of the direction.
    pub(crate) fn pick(&self, origin: [f32; 3], direction: [f32; 3]) -> Option<(Entity, f32)> {
        let hit = self.tlas.closest_hit(&Ray::new(origin, direction))?;
        Some((self.entities[hit.instance.0 as usize], hit.t))
    }

    /// The entities that touch one now.
    pub(crate) fn touching(&self, entity: Entity) -> Vec<Entity> {
        let Some(&instance) = self.instances.get(&entity) else { return vec![] };
        self.contacts.of(instance).map(|other| self.entities[other.0 as usize]).collect()
    }

    fn of(&self, pairs: &[[InstanceId; 2]]) -> Vec<[Entity; 2]> {
        let in_order = |pair: &[InstanceId; 2]| {
            let mut pair = pair.map(|instance| self.entities[instance.0 as usize]);
            pair.sort_unstable();
            pair
        };
        pairs.iter().map(in_order).collect()
    }
}

/// Brings the instances up to date with what the frame changed.
fn follow(
    mut scene: ResMut<CollisionScene>,
    moved: Query<(Entity, &Collider, &GlobalTransform), Or<(Changed<GlobalTransform>, Added<Collider>)>>,
    mut gone: RemovedComponents<Collider>,
) {
    let scene = &mut *scene;
    let mut changed = vec![];
    for entity in gone.read() {
        if let Some(instance) = scene.instances.remove(&entity) {
            scene.tlas.remove(instance).expect("the instance was inserted before");
            changed.push(instance);
        }
    }
    // Pairs that end with an entity that is gone still name it.
    let departed = scene.contacts.update(&scene.tlas, &changed);
    (scene.begun, scene.ended) = (vec![], scene.of(&departed.ended));
    changed.clear();
    for (entity, collider, transform) in &moved {
        let affine = transform.affine();
        let [x, y, z] = [affine.x_axis, affine.y_axis, affine.z_axis].map(|axis| axis.to_array());
        let columns = [x, y, z, affine.translation.to_array()];
        let instance = Instance::new(collider.0, Affine { columns });
        let id = match scene.instances.get(&entity) {
            Some(&id) => scene.tlas.set_instance(id, instance).map(|()| id),
            None => scene.tlas.insert(instance),
        };
        // A transform without an inverse leaves the entity where it was.
        let Ok(id) = id else { continue };
        scene.instances.insert(entity, id);
        let number = id.0 as usize;
        scene.entities.resize(scene.entities.len().max(number + 1), entity);
        scene.entities[number] = entity;
        changed.push(id);
    }
    let changes = scene.contacts.update(&scene.tlas, &changed);
    scene.begun = scene.of(&changes.begun);
    let ended = scene.of(&changes.ended);
    scene.ended.extend(ended);
}
