//! Teaching: how well a learner has done a task of a scene, from the probe's trajectory and from what was measured and
//! answered. Knows no Vulkan and no window; `docs/teaching.md` has the definitions with their sources.

pub mod guide;
pub mod history;
pub mod movement;
pub mod score;
pub mod view;

pub use movement::{Movement, Path};
pub use score::{Attempt, Score};
pub use view::Apart;
