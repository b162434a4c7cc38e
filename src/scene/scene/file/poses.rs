//! The tables `pose`: named poses of the probe.

use super::document::Document;
use super::error::SceneError;
use super::probe::{Pose, look};
use super::table::Table;
use crate::scene::NamedPose;
use crate::settings::{Form, group};

group! {
    /// The name of a pose.
    pub struct PoseKeys in "pose" {
        /// Name of the pose: the view or the structure that it shows.
        name: String = String::new(), Facts::of(Form::Text).required().limits("not empty, once in the file");
    }
}

/// The named poses of a file, in its order.
pub(super) fn build(
    document: &Document<'_>,
    tables: &[Table<PoseKeys>],
) -> Result<Vec<NamedPose>, SceneError> {
    let mut poses: Vec<NamedPose> = Vec::new();
    for (i, table) in tables.iter().enumerate() {
        let fail = |key: &str, message: String, remedy: &str| {
            document.fail(&format!("pose.{i}.{key}"), message, remedy)
        };
        let PoseKeys { name } = table.stated.get("");
        if name.trim().is_empty() {
            return Err(fail(
                "name",
                "a pose needs a name".to_owned(),
                "say what is seen from there",
            ));
        }
        if poses.iter().any(|pose| pose.name == name) {
            let message = format!("there are two poses `{name}`");
            return Err(fail("name", message, "give one another name"));
        }
        let Pose { position, direction, lateral } = table.stated.get("");
        let world_from_probe = look(position.into(), direction.into(), lateral.into())
            .map_err(|[key, message, remedy]| fail(key, message.to_owned(), remedy))?;
        poses.push(NamedPose { name, world_from_probe });
    }
    Ok(poses)
}
