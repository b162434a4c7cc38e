//! Vessels behind bumpy surfaces, as segmentations have them: bumps smaller than the beam do not steer it.

mod full_wave;
mod lumen;
mod patient;
mod phantom;
mod vessels;
