//! The scenes: the dissertation's table 3 and the available models.

use anyhow::Result;

use super::orders::Found;
use crate::models;
use crate::report::{
    effort::Effort,
    model::{Cell, Chapter, Table},
};

/// The dissertation's scenes: name, meshes, vertices, triangles, and our model of it.
const THEIRS: [(&str, usize, usize, usize, Option<&str>); 7] = [
    ("Breakfast room", 240, 961_508, 1_347_596, None),
    ("Buddha", 1, 549_409, 1_087_474, None),
    ("Dragon", 1, 438_976, 871_306, Some("dragon_871k")),
    ("Sponza", 393, 209_610, 262_267, Some("sponza")),
    ("Pirate ship", 29, 364_973, 155_689, None),
    ("Bunny", 1, 147_040, 144_046, Some("bunny")),
    ("Sibenik", 1_087, 155_179, 75_284, None),
];

/// Adds the table, without a finding.
pub(super) fn add(chapter: &mut Chapter, effort: Effort) -> Result<Found> {
    let head = ["scene", "meshes, theirs", "vertices, theirs", "triangles, theirs", "meshes", "vertices", "triangles"];
    let mut table = Table::new("Scenes (table 3): theirs, and our models of them", &head);
    for (scene, n_meshes, n_vertices, n_triangles, ours) in THEIRS {
        let ours = ours.filter(|_| effort != Effort::Tiny).map(models::scene).transpose()?.flatten();
        let mut row = vec![Cell::text(scene)];
        row.extend([n_meshes, n_vertices, n_triangles].map(|n| Cell::text(n.to_string())));
        match ours {
            Some(scene) => {
                let sum = |of: fn(&canted_scene::Mesh) -> usize| scene.meshes.iter().map(of).sum::<usize>();
                let counts = [scene.meshes.len(), sum(|m| m.positions.len()), sum(|m| m.triangles.len())];
                row.extend(counts.map(|n| Cell::text(n.to_string())));
            }
            None => row.extend(["–"; 3].map(Cell::text)),
        }
        table.rows.push(row);
    }
    "Three of the seven models are available here; the Bunny of the dissertation has twice the triangles of the published one."
        .clone_into(&mut table.says);
    chapter.tables.push(table);
    Ok(Found::default())
}
