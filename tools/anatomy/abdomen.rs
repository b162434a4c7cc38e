//! The abdomen's parts: names, tissues, priorities, how finely each is meshed.

use glam::Vec3;

use crate::body;
use crate::field::{Field, Point};
use crate::organs;
use crate::part::{Part, part};
use crate::vessels::{Growth, Piece, Random, Region, lumen};

/// Smooth layers of the wall; their tightest curve is the probe's imprint.
const WALL: (f32, f64) = (7.0, 0.4);
/// The boundaries of the view.
const FAR: (f32, f64) = (4.5, 0.3);
/// Parts mostly in shadow or beside the fan.
const BACK: (f32, f64) = (5.0, 0.1);
/// Organs.
const ORGAN: (f32, f64) = (3.0, 1.0);
/// Parts of a few millimetres.
const FINE: (f32, f64) = (1.6, 2.0);
/// Vessels down to a radius of 1.4 mm.
const VESSEL: (f32, f64) = (1.1, 2.0);

/// All parts, in rising priority: where two overlap, the later one wins.
pub fn parts() -> Vec<Part> {
    let (portal, hepatic) = liver_vessels();
    let walled: Vec<Piece> = portal.iter().copied().filter(|q| q.radii[0] > WALLED).collect();
    let p = &Point::world();
    let layer = |depth: f32| body::fascial_layer(p, depth);
    let gallbladder = organs::gallbladder(p);
    let fat = body::layer(p, body::FAT, 0.2, 3.3);
    let inner_aorta = organs::aorta(p, 0.0);
    let outer_aorta = organs::aorta(p, AORTIC_WALL);
    let outer_gallbladder = gallbladder.clone() - organs::GALLBLADDER_WALL;
    vec![
        part("skin", "skin", WALL, body::wall(p)),
        part("subcutaneous-fat", "fat", WALL, fat),
        part("external-oblique", "muscle", WALL, layer(body::MUSCLE)),
        part("fascia", "fascia", WALL, layer(body::FASCIA)),
        part("intercostals", "muscle", WALL, layer(body::INTERCOSTAL)),
        part("inner-fascia", "fascia", WALL, layer(body::INNER_FASCIA)),
        part("transversus", "muscle", WALL, layer(body::TRANSVERSUS)),
        part("ribs", "cortical_bone", (2.5, 0.6), body::ribs(p)),
        part("lung", "lung", FAR, body::lung(p)),
        part("diaphragm", "muscle", FAR, body::diaphragm(p)),
        part("abdominal-fat", "visceral_fat", FAR, body::cavity(p)),
        part("back-muscles", "muscle", BACK, body::back_muscles(p)),
        part("discs", "muscle", BACK, body::discs(p)),
        part("vertebrae", "cortical_bone", (3.0, 0.1), body::vertebrae(p)),
        part("colon-wall", "muscle", ORGAN, organs::colon_wall(p)),
        part("colon-content", "stool", ORGAN, organs::colon_content(p)),
        part("colon-gas", "air", ORGAN, organs::colon_gas(p)),
        part("kidney", "kidney", ORGAN, organs::kidney(p)),
        part("renal-pyramids", "renal_pyramid", FINE, organs::renal_pyramids(p)),
        part("renal-sinus", "renal_sinus", FINE, organs::renal_sinus(p)),
        part("liver", "liver", ORGAN, organs::liver(p)),
        part("gallbladder-wall", "vessel_wall", FINE, outer_gallbladder),
        part("gallbladder", "bile", FINE, gallbladder),
        part("vena-cava", "blood", ORGAN, organs::vena_cava(p)),
        part("aorta-wall", "vessel_wall", (2.2, 0.5), outer_aorta),
        part("aorta", "blood", (2.2, 0.5), inner_aorta),
        part("hepatic-veins", "blood", VESSEL, lumen(p, &hepatic, 0.0)),
        part("portal-wall", "vessel_wall", VESSEL, lumen(p, &walled, PORTAL_WALL)),
        part("portal-vein", "blood", VESSEL, lumen(p, &portal, 0.0)),
        part("cyst", "cyst_fluid", FINE, organs::cyst(p)),
        part("lesion", "tumour", FINE, organs::lesion(p)),
    ]
}

/// What tells up from down: the body around the block, and the navel on it.
pub fn around() -> Vec<Part> {
    let p = &Point::world();
    vec![
        part("body", "body_skin", (10.0, 0.05), body::rest(p)),
        part("navel", "skin", (2.0, 1.0), body::navel(p)),
    ]
}

/// Thickness of the aortic wall, mm.
const AORTIC_WALL: f32 = 1.6;

/// Thickness of the portal sheath of Glisson, mm: it makes the walls of portal veins bright; hepatic
/// veins have none.
const PORTAL_WALL: f32 = 0.9;

/// Portal branches wider than this radius, mm, show their sheath.
const WALLED: f32 = 2.3;

/// Box around the liver, mm.
const LIVER_BOX: (Vec3, Vec3) = (Vec3::new(-136.0, -80.0, -64.0), Vec3::new(60.0, 76.0, 104.0));

/// Portal and hepatic trees, grown apart: radii 6 to 1.4 mm, six generations.
fn liver_vessels() -> (Vec<Piece>, Vec<Piece>) {
    let liver = Field::new(&organs::liver(&Point::world()));
    let region = Region::new(&liver, LIVER_BOX.0, LIVER_BOX.1);
    // Of 500 trees the one that shows most of both kinds in the default slice without merging them.
    let mut random = Random(424);
    let points = region.points(7.0, 11.0, &mut random);
    let trunk = organs::portal_trunk();
    let growth = Growth { region: &region, avoid: &[], min_radius: 1.4, generations: 6 };
    let heading = organs::PORTA - trunk[trunk.len() - 2].ends[0];
    let mut portal = trunk;
    portal.extend(growth.grow(organs::PORTA, heading, 6.0, points.clone(), &mut random));

    // Three hepatic veins: right, middle, left; they run between the portal sectors.
    let growth = Growth { avoid: &portal, ..growth };
    let mut hepatic = Vec::new();
    let roots = [
        (Vec3::new(-0.9, 0.1, -0.4), 5.0, (f32::NEG_INFINITY, -80.0)),
        (Vec3::new(-0.5, -0.8, -0.4), 4.4, (-80.0, -40.0)),
        (Vec3::new(0.5, -0.8, -0.3), 4.2, (-40.0, f32::INFINITY)),
    ];
    for (heading, radius, (from, to)) in roots {
        let own = points.iter().filter(|p| (from..to).contains(&p.x));
        let start = organs::CAVAL_CONFLUENCE + heading.normalize() * 6.0;
        let own = own.copied().collect();
        hepatic.extend(growth.grow(start, heading, radius, own, &mut random));
    }
    (portal, hepatic)
}
