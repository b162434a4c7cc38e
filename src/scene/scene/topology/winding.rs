//! Orientation of triangles: neighbours must agree, and closed meshes face outward.

use std::path::Path;

use glam::DVec3;

use super::{Edges, cavities, six_volumes, volume};
use crate::issue::Issue;
use crate::scene::mesh::Soup;

/// Turns triangles so that neighbours agree, by the majority of each connected piece; then turns a
/// closed mesh of negative volume.
pub fn orient(path: &Path, soup: &mut Soup) -> Vec<Issue> {
    let mut issues = Vec::new();
    let Agreement { turned, contradictions, body_of, inward } = agree(soup);
    let bodies = inward.len();
    if turned > 0 {
        issues.push(Issue::warning(
            path,
            turned,
            format!("inconsistent winding: {turned} triangles were turned to agree with their neighbours"),
            "recalculate normals in the modeller",
        ));
    }
    if contradictions > 0 {
        issues.push(Issue::warning(
            path,
            contradictions,
            format!(
                "inconsistent winding: {contradictions} edges cannot agree (a one-sided surface)"
            ),
            "make the surface enclose a volume",
        ));
    }
    if volume(soup) < 0.0 && Edges::of(soup).open().next().is_none() {
        for t in &mut soup.triangles {
            t.swap(1, 2);
        }
        issues.push(Issue::warning(
            path,
            soup.triangles.len(),
            "inside out (its volume is negative): all triangles were turned",
            "flip the normals in the modeller",
        ));
    } else if inward.contains(&true) && inward.contains(&false) {
        let wrong = cavities::inside_out(soup, &body_of, &inward);
        if wrong > 0 {
            issues.push(Issue::warning(
                path,
                wrong,
                format!(
                    "{wrong} of {bodies} closed bodies face inwards and lie in no other: inside out"
                ),
                "flip them in the modeller",
            ));
        }
    }
    issues
}

/// Result of a flood fill over all pieces.
#[derive(Default)]
struct Agreement {
    /// Triangles turned to agree with the majority of their piece.
    turned: usize,
    /// Edges whose triangles cannot agree.
    contradictions: usize,
    /// Closed piece of each triangle, `u32::MAX` for none, and whether each piece has a negative volume.
    body_of: Vec<u32>,
    inward: Vec<bool>,
}

/// Flood fill over edges of two triangles; turns the minority of each piece.
fn agree(soup: &mut Soup) -> Agreement {
    let count = soup.triangles.len();
    let mut neighbours: Vec<[(u32, bool); 3]> = vec![[(u32::MAX, false); 3]; count];
    let mut used = vec![0usize; count];
    for group in Edges::of(soup).groups() {
        let [a, b] = group else { continue };
        let same = a.forward != b.forward;
        for (from, to) in [(a, b), (b, a)] {
            let t = from.triangle as usize;
            neighbours[t][used[t]] = (to.triangle, same);
            used[t] += 1;
        }
    }
    let mut turn: Vec<Option<bool>> = vec![None; count];
    let mut found = Agreement { body_of: vec![u32::MAX; count], ..Agreement::default() };
    for start in 0..count {
        if turn[start].is_some() {
            continue;
        }
        turn[start] = Some(false);
        let mut piece = vec![start];
        let mut next = 0;
        while let Some(&t) = piece.get(next) {
            next += 1;
            for &(other, same) in &neighbours[t][..used[t]] {
                let wanted = turn[t] == Some(same);
                match turn[other as usize] {
                    None => {
                        turn[other as usize] = Some(wanted);
                        piece.push(other as usize);
                    }
                    Some(has) if has == wanted => {}
                    Some(_) => found.contradictions += 1,
                }
            }
        }
        let minority = piece.iter().filter(|&&t| turn[t] == Some(true)).count();
        let other_way = minority * 2 > piece.len();
        let origin = DVec3::from(soup.positions[soup.triangles[start][0] as usize].map(f64::from));
        let mut six = 0.0;
        for &t in &piece {
            if (turn[t] == Some(true)) != other_way {
                soup.triangles[t].swap(1, 2);
                found.turned += 1;
            }
            six += six_volumes(soup, soup.triangles[t], origin);
        }
        if piece.iter().all(|&t| used[t] == 3) {
            let body = found.inward.len() as u32;
            piece.iter().for_each(|&t| found.body_of[t] = body);
            found.inward.push(six < 0.0);
        }
    }
    // Each conflicting edge is met from both of its triangles.
    found.contradictions /= 2;
    found
}
