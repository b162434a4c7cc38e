//! Data sets from Python: shards of a plan.

use std::path::PathBuf;

use insonify::dataset::{DatasetError, Event, Plan, Run, Store, colours};
use insonify::issue::explanation;
use insonify::sim::Tracer;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{InsonifyError, SceneError, mistaken, raised};
use crate::simulator::{opened, tracer_of};

fn failed(error: &DatasetError) -> PyErr {
    match error {
        DatasetError::Scene(_) => SceneError::new_err(explanation(error)),
        _ => InsonifyError::new_err(explanation(error)),
    }
}

/// As insonify.make_dataset, which has the defaults.
#[pyfunction]
#[pyo3(signature = (plan, output, shard, resume, check, device, tracer, heard))]
#[allow(
    clippy::too_many_arguments,
    reason = "those of the function in Python, which has their defaults"
)]
pub fn make_dataset<'py>(
    py: Python<'py>,
    plan: PathBuf,
    output: PathBuf,
    shard: [u32; 2],
    resume: bool,
    check: bool,
    device: Option<String>,
    tracer: &str,
    heard: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let wanted: Option<Tracer> = tracer_of(tracer)?;
    let [index, count] = shard;
    if index >= count {
        let text = format!(
            "shard ({index}, {count}): of n shards the first is (0, n), the last (n - 1, n)"
        );
        return Err(pyo3::exceptions::PyValueError::new_err(text));
    }
    let (plan, warnings) = py.detach(|| Plan::load(&plan)).map_err(|e| mistaken(&e))?;
    let run = Run { plan: &plan, root: &output, shard, resume };
    py.detach(|| run.check()).map_err(|e| failed(&e))?;
    let (samples, parts) = (run.samples(), run.parts().len());
    let [mut made, mut kept] = [0, 0];
    let mut sheet = None;
    let heard = heard.clone().unbind();
    let mut raised_by = None;
    if parts > 0 && !check {
        crate::process::enter()?;
        let made_and_told = py.detach(|| {
            let device = opened(device, wanted, false).map_err(|e| raised(&e))?;
            let mut hear = |_: &Store<'_>, event: Event<'_>| {
                match event {
                    Event::Made(_) => made += 1,
                    Event::Kept => kept += 1,
                    Event::Part(_) => return Ok(()),
                }
                let heard = Python::attach(|py| {
                    py.check_signals()?;
                    heard.call1(py, (made + kept, samples)).map(drop)
                });
                heard.map_err(|error| {
                    raised_by = Some(error);
                    DatasetError::Stopped
                })
            };
            run.make(&device, wanted, &mut hear).map_err(|e| failed(&e))
        });
        sheet = match (made_and_told, raised_by) {
            (_, Some(error)) => return Err(error),
            (sheet, None) => Some(sheet?),
        };
    }
    let out = PyDict::new(py);
    out.set_item("samples", samples)?;
    out.set_item("parts", parts)?;
    out.set_item("made", made)?;
    out.set_item("kept", kept)?;
    out.set_item("sheet", sheet)?;
    out.set_item("classes", plan.classes.clone())?;
    out.set_item(
        "colours",
        colours(&plan).into_iter().map(|colour| colour.map(u32::from)).collect::<Vec<_>>(),
    )?;
    out.set_item("warnings", warnings.iter().map(ToString::to_string).collect::<Vec<_>>())?;
    Ok(out)
}
