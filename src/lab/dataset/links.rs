//! Draws that refer to others: what follows, and what is correlated.

use super::draws::{Draw, DrawKind};
use super::reading::Read;
use crate::scene::SceneError;
use crate::scene::file::Document;
use crate::settings::{Value, suggest};

/// The draws with what they refer to as places in the list. Of two of one name the later one counts.
pub(super) fn linked(document: &Document<'_>, read: Vec<Read>) -> Result<Vec<Draw>, SceneError> {
    let mut all: Vec<Read> = Vec::with_capacity(read.len());
    for one in read {
        match all.iter().position(|other| other.draw.name == one.draw.name) {
            Some(before) => all[before] = one,
            None => all.push(one),
        }
    }
    let names: Vec<String> = all.iter().map(|one| one.draw.name.clone()).collect();
    let mut draws = Vec::with_capacity(all.len());
    let mut places = Vec::with_capacity(all.len());
    for Read { mut draw, other } in all {
        if let Some((name, at)) = other {
            let Some(index) = names.iter().position(|n| *n == name) else {
                let message = format!("`{name}` is neither drawn nor a variable here");
                let remedy = suggest::among(&name, names.iter().map(String::as_str));
                return Err(document.fail(&at, message, remedy));
            };
            match &mut draw.kind {
                DrawKind::Follows { of, .. } => *of = index,
                _ => draw.with = draw.with.map(|(_, coefficient)| (index, coefficient)),
            }
            places.push(Some((index, at)));
        } else {
            places.push(None);
        }
        draws.push(draw);
    }
    for (begin, place) in places.iter().enumerate() {
        let Some((_, at)) = place else { continue };
        let mut index = begin;
        for _ in 0..draws.len() {
            match &places[index] {
                Some((next, _)) => index = *next,
                None => break,
            }
            if index == begin {
                let message = format!("`{}` depends on itself", names[begin]);
                return Err(document.fail(at, message, "draw one of the circle by itself"));
            }
        }
    }
    for (draw, place) in draws.iter().zip(&places) {
        let Some((other, at)) = place else { continue };
        let number = draws[*other].ends(&draws).iter().all(|v| v.number.is_some());
        match &draw.kind {
            DrawKind::Follows { .. } if !number => {
                let message = format!("`{}` is no number", names[*other]);
                return Err(document.fail(at, message, "follow a number"));
            }
            DrawKind::Follows { .. } => {}
            _ if matches!(draws[*other].kind, DrawKind::Constant(_) | DrawKind::Follows { .. }) => {
                let message = format!("`{}` is not drawn by itself", names[*other]);
                return Err(document.fail(
                    at,
                    message,
                    "be correlated with what is drawn by a distribution",
                ));
            }
            _ => {}
        }
        in_range(document, draw, &draws)?;
    }
    Ok(draws)
}

/// Fails where a value that follows another one leaves the range of its key.
fn in_range(document: &Document<'_>, draw: &Draw, all: &[Draw]) -> Result<(), SceneError> {
    for number in draw.ends(all).iter().filter_map(|value| value.number) {
        let fault = draw.facts.and_then(|facts| facts.fault(&Value::Number(number)));
        if let Some((message, remedy)) = fault {
            return Err(document.fail(
                &draw.at,
                format!("at an end of what it follows {message}"),
                remedy,
            ));
        }
    }
    Ok(())
}
