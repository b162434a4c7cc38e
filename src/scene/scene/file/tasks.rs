//! The tables `task`: what a learner is to do in the scene.

use std::sync::Arc;

use super::document::Document;
use super::error::SceneError;
use super::fusion::closed_mesh;
use super::probe::{Pose, look};
use super::table::Table;
use crate::scene::task::{
    Cover, Goal, Measurement, Question, Target, Task, Unit, longest_axis, volume,
};
use crate::scene::{Instance, Mesh, NamedPose};
use crate::settings::units::{ANGLE, DURATION, LENGTH};
use crate::settings::{Form, Words, group, suggest, words};

words! {
    /// Kinds of tasks.
    pub enum TaskKind {
        /// A view to reach.
        View = "view",
        /// Structures to show.
        Show = "show",
        /// A measurement to take.
        Measure = "measure",
        /// A case to recognise.
        Question = "question",
    }
}

words! {
    /// What is computed of a mesh.
    pub enum Size {
        /// Its longest axis.
        Longest = "longest axis",
        /// The volume that it encloses.
        Volume = "volume",
    }
}

const DEGREE: f64 = std::f64::consts::PI / 180.0;

group! {
    /// A task.
    pub struct TaskKeys in "task" {
        /// Name of the task.
        name: String = String::new(), Facts::of(Form::Text).required().limits("not empty, once in the file");
        /// A view to reach, structures to show, a measurement to take, or a question to answer. Each takes the keys
        /// that are said below to be its own, and those of every task: `name`, `text`, `hints`.
        kind: TaskKind = TaskKind::View, Facts::word::<TaskKind>();
        /// What the learner is to do, or the question.
        text: String = String::new(), Facts::of(Form::Text).required().limits("not empty");
        /// Hints, which the guide gives one after the other.
        hints: Vec<String> = Vec::new(), Facts::of(Form::Texts).by_default("none");
        /// Where the probe is put when the task begins in the window, by the name of a `[[pose]]`.
        start: Option<String> = None, Facts::of(Form::Text).by_default("where it is");
        /// View: the target, by the name of a `[[pose]]`; else `position`, `direction` and `lateral` say it.
        pose: Option<String> = None, Facts::of(Form::Text);
        /// View: greatest distance between the middles of the two images - on the central scanline, at half the depth.
        distance: f64 = 10.0, Facts::quantity(&LENGTH, 0.0, 1000.0);
        /// View: greatest angle between the two image planes. One that is left to right the other's is at 180 deg.
        plane_angle: f64 = 10.0 * DEGREE, Facts::quantity(&ANGLE, 0.0, 180.0 * DEGREE);
        /// View: greatest rotation of the image within its plane.
        turn: f64 = 20.0 * DEGREE, Facts::quantity(&ANGLE, 0.0, 180.0 * DEGREE);
        /// View: time for which it has to be held, up to the end.
        hold: f64 = 1.0, Facts::quantity(&DURATION, 0.0, 60.0);
        /// View, show: least share of the probe's face that touches the skin, where the scene has `[contact]`.
        contact: f64 = 0.5, Facts::number(0.0, 1.0);
        /// Show: names of the meshes that have to be seen. Measure: the one mesh whose `size` is the true value.
        mesh: Vec<String> = Vec::new(), Facts::of(Form::OneOrSeveral).by_default("none");
        /// Show: least area of the image, in mm2, in which each of the meshes is seen, by the labels of the pixels.
        area: f64 = 100.0, Facts::number(0.0, 1e6);
        /// Measure: the true value, in `unit`; or else `mesh` and `size` say it.
        value: Option<f64> = None, Facts::number(1e-6, 1e6);
        /// Measure: unit of `value`.
        unit: Unit = Unit::Length, Facts::word::<Unit>();
        /// Measure: what of the mesh: its longest axis, mm, or the volume that it encloses, ml; as it is at time 0.
        size: Size = Size::Longest, Facts::word::<Size>();
        /// Measure: greatest error, in percent of the true value.
        tolerance: f64 = 10.0, Facts::number(0.0, 1000.0);
        /// Question: the answers to choose from.
        choices: Vec<String> = Vec::new(), Facts::of(Form::Texts).limits("two or more, all different");
        /// Question: the right one of them.
        answer: String = String::new(), Facts::of(Form::Text).limits("one of `choices`");
        /// Question: why it is right, shown afterwards.
        explanation: String = String::new(), Facts::of(Form::Text);
    }
}

/// Keys of one kind alone or of two; the others are every task's.
const OWN: [(&str, &[TaskKind]); 17] = [
    ("pose", &[TaskKind::View]),
    ("position", &[TaskKind::View]),
    ("direction", &[TaskKind::View]),
    ("lateral", &[TaskKind::View]),
    ("distance", &[TaskKind::View]),
    ("plane_angle", &[TaskKind::View]),
    ("turn", &[TaskKind::View]),
    ("hold", &[TaskKind::View]),
    ("contact", &[TaskKind::View, TaskKind::Show]),
    ("mesh", &[TaskKind::Show, TaskKind::Measure]),
    ("area", &[TaskKind::Show]),
    ("value", &[TaskKind::Measure]),
    ("unit", &[TaskKind::Measure]),
    ("size", &[TaskKind::Measure]),
    ("tolerance", &[TaskKind::Measure]),
    ("choices", &[TaskKind::Question]),
    ("answer", &[TaskKind::Question]),
];

/// The table of a task, and where it stands.
struct Place<'d> {
    document: &'d Document<'d>,
    index: usize,
    table: &'d Table<TaskKeys>,
}

impl Place<'_> {
    fn fail(&self, key: &str, message: impl Into<String>, remedy: impl Into<String>) -> SceneError {
        self.document.fail(&format!("task.{}.{key}", self.index), message, remedy)
    }

    fn has(&self, key: &str) -> bool {
        self.table.stated.has(key)
    }
}

/// The tasks of a file, in its order.
pub(super) fn build(
    document: &Document<'_>,
    tables: &[Table<TaskKeys>],
    poses: &[NamedPose],
    meshes: &[Arc<Mesh>],
    instances: &[Instance],
) -> Result<Vec<Task>, SceneError> {
    let mut tasks: Vec<Task> = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let place = Place { document, index, table };
        let keys: TaskKeys = table.stated.get("");
        for (key, text, remedy) in [
            ("name", &keys.name, "say in a few words what it is about"),
            ("text", &keys.text, "say what the learner is to do"),
        ] {
            if text.trim().is_empty() {
                return Err(place.fail(key, format!("a task needs a {key}"), remedy));
            }
        }
        if tasks.iter().any(|task| task.name == keys.name) {
            let message = format!("there are two tasks `{}`", keys.name);
            return Err(place.fail("name", message, "give one another name"));
        }
        let strange =
            |(key, kinds): &&(&str, &[TaskKind])| place.has(key) && !kinds.contains(&keys.kind);
        if let Some((key, kinds)) = OWN.iter().find(strange) {
            let message = format!("`{key}` does not belong to a task of kind {}", keys.kind.word());
            let kinds: Vec<_> = kinds.iter().map(|kind| kind.word()).collect();
            let remedy = format!("remove it, or give the task the kind {}", kinds.join(" or "));
            return Err(place.fail(key, message, remedy));
        }
        let goal = match keys.kind {
            TaskKind::View => Goal::View(target(&place, &keys, poses)?),
            TaskKind::Show => Goal::Show(cover(&place, &keys, instances)?),
            TaskKind::Measure => Goal::Measure(measurement(&place, &keys, meshes, instances)?),
            TaskKind::Question => Goal::Question(question(&place, &keys)?),
        };
        let start = keys.start.as_deref().map(|name| named(&place, "start", name, poses));
        let start = start.transpose()?.map(|pose| pose.world_from_probe);
        tasks.push(Task { name: keys.name, text: keys.text, hints: keys.hints, start, goal });
    }
    Ok(tasks)
}

fn target(place: &Place<'_>, keys: &TaskKeys, poses: &[NamedPose]) -> Result<Target, SceneError> {
    let stated = &place.table.stated;
    let own = ["position", "direction", "lateral"].into_iter().find(|key| stated.has(key));
    let world_from_probe = match (&keys.pose, own) {
        (Some(_), Some(key)) => {
            let message = format!("both a named pose and `{key}` are given");
            return Err(place.fail(key, message, "give one of them"));
        }
        (None, None) => {
            let message = "this view has no target";
            let remedy = "name a [[pose]] with `pose`, or give position, direction and lateral";
            return Err(place.fail("name", message, remedy));
        }
        (Some(name), None) => named(place, "pose", name, poses)?.world_from_probe,
        (None, Some(_)) => {
            let Pose { position, direction, lateral } = stated.get("");
            look(position.into(), direction.into(), lateral.into())
                .map_err(|[key, message, remedy]| place.fail(key, message, remedy))?
        }
    };
    let TaskKeys { distance, plane_angle, turn, hold, contact, .. } = *keys;
    Ok(Target { world_from_probe, distance, plane_angle, turn, hold, contact })
}

fn named<'p>(
    place: &Place<'_>,
    key: &str,
    name: &str,
    poses: &'p [NamedPose],
) -> Result<&'p NamedPose, SceneError> {
    poses.iter().find(|pose| pose.name == name).ok_or_else(|| {
        let remedy = match poses.is_empty() {
            true => "add it as [[pose]]".to_owned(),
            false => suggest::among(name, poses.iter().map(|pose| pose.name.as_str())),
        };
        place.fail(key, format!("there is no pose `{name}`"), remedy)
    })
}

/// Fails where a task names a pose that is not there; for files that are about to be written.
pub(super) fn poses_exist(
    document: &Document<'_>,
    tables: &[Table<TaskKeys>],
    poses: &[NamedPose],
) -> Result<(), SceneError> {
    for (index, table) in tables.iter().enumerate() {
        for key in ["pose", "start"] {
            if let Some(name) = table.stated.text(key) {
                named(&Place { document, index, table }, key, name, poses)?;
            }
        }
    }
    Ok(())
}

fn cover(place: &Place<'_>, keys: &TaskKeys, instances: &[Instance]) -> Result<Cover, SceneError> {
    if keys.mesh.is_empty() {
        let remedy = "name with `mesh` what has to be seen";
        return Err(place.fail("name", "this task shows no mesh", remedy));
    }
    let instances = keys.mesh.iter().map(|name| mesh(place, name, instances));
    let instances = instances.collect::<Result<_, _>>()?;
    Ok(Cover { instances, area: keys.area, contact: keys.contact })
}

fn mesh(place: &Place<'_>, name: &str, instances: &[Instance]) -> Result<usize, SceneError> {
    instances.iter().position(|i| i.name == name).ok_or_else(|| {
        let remedy = suggest::among(name, instances.iter().map(|i| i.name.as_str()));
        place.fail("mesh", format!("there is no mesh `{name}`"), remedy)
    })
}

fn measurement(
    place: &Place<'_>,
    keys: &TaskKeys,
    meshes: &[Arc<Mesh>],
    instances: &[Instance],
) -> Result<Measurement, SceneError> {
    let (value, unit) = match (keys.value, &keys.mesh[..]) {
        (Some(value), []) if place.has("size") => {
            let message = format!("`size` belongs to a mesh, and the value is {value}");
            return Err(place.fail("size", message, "remove `size` or `value`"));
        }
        (Some(value), []) => (value, keys.unit),
        (None, [_]) if place.has("unit") => {
            let remedy = "remove it: a longest axis is in mm, a volume in ml";
            return Err(place.fail("unit", "the mesh's size has a unit of its own", remedy));
        }
        (None, [name]) => {
            let found = match keys.size {
                Size::Longest => mesh(place, name, instances)?,
                Size::Volume => {
                    let path = format!("task.{}.mesh", place.index);
                    let what = "measured by its volume";
                    closed_mesh(place.document, &path, name, what, meshes, instances)?
                }
            };
            let instance = &instances[found];
            let (shape, placed) = (&meshes[instance.mesh], &instance.world_from_object);
            match keys.size {
                Size::Longest => (longest_axis(shape, placed), Unit::Length),
                Size::Volume => (volume(shape, placed), Unit::Volume),
            }
        }
        (Some(_), _) => {
            let message = "both a value and a mesh are given";
            return Err(place.fail("value", message, "give one of them"));
        }
        (None, _) => {
            let message = "this measurement has no true value";
            return Err(place.fail("name", message, "give `value`, or one `mesh` and `size`"));
        }
    };
    if value.is_nan() || value <= 0.0 {
        let message = format!("the true value is {value}");
        return Err(place.fail("mesh", message, "name a mesh that has a size, or give `value`"));
    }
    Ok(Measurement { value, unit, tolerance: keys.tolerance })
}

fn question(place: &Place<'_>, keys: &TaskKeys) -> Result<Question, SceneError> {
    let lower: Vec<String> = keys.choices.iter().map(|c| c.trim().to_lowercase()).collect();
    let twice = |i: &usize| lower[..*i].contains(&lower[*i]);
    if lower.len() < 2 || lower.iter().any(String::is_empty) {
        let message = "a question needs two answers or more, none of them empty";
        let key = if place.has("choices") { "choices" } else { "name" };
        return Err(place.fail(key, message, "give them as `choices`"));
    }
    if let Some(i) = (0..lower.len()).find(twice) {
        let message = format!("the answer `{}` is there twice", keys.choices[i]);
        return Err(place.fail("choices", message, "remove one"));
    }
    let out = Question {
        choices: keys.choices.clone(),
        answer: 0,
        explanation: keys.explanation.clone(),
    };
    match out.choice(&keys.answer) {
        Some(answer) => Ok(Question { answer, ..out }),
        None => {
            let message = format!("the answer `{}` is none of the choices", keys.answer);
            let key = if place.has("answer") { "answer" } else { "name" };
            Err(place.fail(
                key,
                message,
                suggest::among(&keys.answer, keys.choices.iter().map(String::as_str)),
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::file::tests::Case;
    use crate::scene::task::Goal;
    use crate::scene::{Scene, SceneError};

    const BALL: &str = "[[pose]]\nname = \"p\"\nposition = [1, 2, 3]\n[[mesh]]\nname = \"ball\"\ntissue = \"fat\"\n\
                        shape = { sphere = { radius = 10, subdivisions = 5 } }\n";

    fn load(task: &str) -> Result<Scene, SceneError> {
        let case = Case::new();
        std::fs::write(case.path(), format!("{BALL}{task}")).expect("written");
        Scene::load(&case.path(), &[]).map(|(scene, _)| scene)
    }

    #[test]
    fn every_kind_is_read() {
        let scene = load(
            "[[task]]\nname = \"a\"\ntext = \"go\"\npose = \"p\"\ndistance = \"1 cm\"\nturn = \"5 deg\"\n\
             [[task]]\nname = \"b\"\ntext = \"show\"\nkind = \"show\"\nmesh = \"ball\"\narea = 50\n\
             [[task]]\nname = \"c\"\ntext = \"how long\"\nkind = \"measure\"\nmesh = \"ball\"\n\
             [[task]]\nname = \"d\"\ntext = \"how large\"\nkind = \"measure\"\nmesh = \"ball\"\nsize = \"volume\"\n\
             [[task]]\nname = \"e\"\ntext = \"what\"\nkind = \"question\"\nchoices = [\"A\", \"B\"]\nanswer = \"b\"\n",
        )
        .expect("sound");
        let Goal::View(target) = &scene.tasks[0].goal else { panic!("{:?}", scene.tasks[0]) };
        assert_eq!(target.world_from_probe, scene.poses[0].world_from_probe);
        assert!(target.distance == 10.0 && (target.turn.to_degrees() - 5.0).abs() < 1e-9);
        let Goal::Show(cover) = &scene.tasks[1].goal else { panic!("{:?}", scene.tasks[1]) };
        assert!(cover.instances == [0] && cover.area == 50.0);
        let values: Vec<f64> = scene.tasks[2..4]
            .iter()
            .map(|task| match &task.goal {
                Goal::Measure(measurement) => measurement.value,
                other => panic!("{other:?}"),
            })
            .collect();
        assert!((values[0] - 20.0).abs() < 0.01, "{values:?}");
        assert!((values[1] / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01, "{values:?}");
        let Goal::Question(question) = &scene.tasks[4].goal else { panic!("{:?}", scene.tasks[4]) };
        assert_eq!(question.answer, 1);
    }

    #[test]
    fn mistakes_have_line_and_remedy() {
        let first = BALL.lines().count() + 1;
        let task = "[[task]]\nname = \"a\"\ntext = \"go\"\n";
        for (keys, line, cause, remedy) in [
            ("", 1, "no target", "position"),
            ("pose = \"q\"\n", 3, "no pose `q`", "`p`"),
            ("pose = \"p\"\nlateral = [1, 0, 0]\n", 4, "both", "one of them"),
            ("pose = \"p\"\narea = 3\n", 4, "does not belong", "show"),
            ("pose = \"p\"\ndistance = -1\n", 4, "distance is -1", "between"),
            ("kind = \"show\"\n", 1, "no mesh", "`mesh`"),
            ("kind = \"show\"\nmesh = \"bal\"\n", 4, "no mesh `bal`", "`ball`"),
            ("kind = \"measure\"\n", 1, "no true value", "`value`"),
            ("kind = \"measure\"\nvalue = 3\nmesh = \"ball\"\n", 4, "both", "one of them"),
            ("kind = \"question\"\nchoices = [\"A\"]\n", 4, "two answers", "choices"),
            ("kind = \"question\"\nchoices = [\"A\", \"a\"]\n", 4, "twice", "remove"),
            ("kind = \"question\"\nchoices = [\"A\", \"B\"]\nanswer = \"C\"\n", 5, "none of", "A"),
        ] {
            let error = load(&format!("{task}{keys}")).expect_err(keys);
            assert!(error.message.contains(cause), "{keys}: {error}");
            assert_eq!(error.line, first + line, "{keys}: {error}");
            let advice = error.remedy.expect("a remedy");
            assert!(advice.contains(remedy), "{keys}: {advice}");
        }
        let twice = load(&format!("{task}pose = \"p\"\n{task}pose = \"p\"\n"));
        assert!(twice.expect_err("twice").message.contains("two tasks"));
    }
}
