//! Brings what lies on the device up to date with the scene before a frame.

use std::time::{Duration, Instant};

use super::batches::{Batches, FrameBudget};
use super::contact::{self, Coupling};
use super::lane::Shot;
use super::line::LineRange;
use super::passes::Passes;
use super::stages::{inputs, label, trace};
use super::tables::Tables;
use super::world::World;
use super::{SimError, layout, stages};
use crate::gpu::{Commands, GpuError};
use crate::scene::Scene;

impl Passes {
    /// Brings the device up to date with `scene` and as many lanes as there are shots; returns the processor time for
    /// it.
    pub(super) fn update(
        &mut self,
        cmd: &mut Commands,
        scene: &Scene,
        tables: &Tables,
        coincident: bool,
        shots: &[Shot],
        line: Option<LineRange>,
    ) -> Result<Duration, SimError> {
        cmd.scope("update");
        let began = Instant::now();
        let labelled = scene.simulation.labels;
        self.lanes[0].buffers.add(cmd.device(), stages::needed(scene))?;
        while self.lanes.len() < shots.len() {
            self.lanes.push(self.lanes[0].beside(cmd.device(), scene, stages::needed(scene))?);
        }
        self.active = shots.len();
        if labelled && self.last.is_some() && !self.remembers {
            self.world.remember(cmd)?;
        }
        // Labels say what has moved since the last image, whatever lines were made between.
        self.remembers = labelled && line.is_some();
        self.world.update(cmd, scene)?;
        // A frame of fewer lines than the buffers were made for must not want more room.
        let buffers = &self.lanes[0].buffers;
        let budget = FrameBudget {
            segments: buffers[&trace::SEGMENTS].size(),
            at_once: self.batches.rounds.at_once,
            main_paths: buffers.room().main_paths,
        };
        let frame;
        (frame, self.batches) =
            frame_constants(tables.frame(scene), &self.world, coincident, &budget, line.as_ref());
        if labelled && self.last.is_none() {
            self.world.remember(cmd)?;
        }
        for (lane, shot) in self.lanes.iter_mut().zip(shots) {
            let frame = shot.constants(&frame);
            lane.set(cmd, frame, tables)?;
            if line.is_some() {
                continue;
            }
            // What the last image was made of, where labels say what has moved since; for the first one its own.
            let last = self.last.replace(frame).unwrap_or(frame);
            if labelled {
                cmd.write(&lane.buffers[&label::FRAME_BEFORE], 0, bytemuck::bytes_of(&last))?;
            }
            if let Some(fusion) = &mut lane.fusion {
                fusion.update(cmd, scene, &lane.buffers)?;
            }
        }
        Ok(began.elapsed())
    }

    /// Computes which elements of the probe's face are coupled to the skin, and writes them to the device.
    pub(super) fn touch(
        &mut self,
        cmd: &mut Commands,
        scene: &Scene,
        shots: &[Shot],
    ) -> Result<(), GpuError> {
        for (lane, shot) in self.lanes.iter_mut().zip(shots) {
            let coupling = Coupling::at(scene, &shot.world_from_probe, &mut self.skins);
            let shares = contact::table(scene, coupling.as_ref());
            cmd.write(&lane.buffers[&inputs::CONTACT], 0, bytemuck::cast_slice(&shares))?;
            lane.touch = coupling.map(|coupling| coupling.touch);
        }
        Ok(())
    }
}

/// A frame's constants with those that depend on the world and on the room for segments.
pub(super) fn frame_constants(
    mut frame: layout::Frame,
    world: &World,
    coincident: bool,
    budget: &FrameBudget,
    line: Option<&LineRange>,
) -> (layout::Frame, Batches) {
    if let Some(line) = line {
        line.narrow(&mut frame);
    }
    if coincident {
        frame.flags |= layout::FLAG_COINCIDENT;
    }
    let (ray_mask, ambiguous) = world.ray_mask();
    frame.ray_mask = ray_mask;
    if ambiguous {
        frame.flags |= layout::FLAG_SLOTS;
    }
    let batches = Batches::new(&frame, budget);
    frame.segment_capacity = batches.capacity;
    (frame, batches)
}
