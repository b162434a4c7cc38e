//! The bindings, push constants and work-group size of a kernel, from its SPIR-V.

use std::collections::HashMap;

use ash::vk;
use spirq::ReflectConfig;
use spirq::entry_point::ExecutionModel;
use spirq::ty::{AccessType, DescriptorType, Type};
use spirq::var::Variable;

use super::workgroup::shared_bytes;

/// First word of every SPIR-V module of this byte order.
const SPIRV_MAGIC: u32 = 0x0723_0203;

/// Kind of object bound at one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// `buffer` block.
    StorageBuffer,
    /// `uniform` block.
    UniformBuffer,
    /// `image2D`, `image3D`.
    StorageImage,
    /// `texture2D`, `texture3D`.
    SampledImage,
    /// `sampler2D`, `sampler3D`.
    ImageAndSampler,
    /// `sampler`.
    Sampler,
    /// `accelerationStructureEXT`.
    AccelerationStructure,
}

impl BindingKind {
    pub(crate) fn descriptor_type(self) -> vk::DescriptorType {
        match self {
            Self::StorageBuffer => vk::DescriptorType::STORAGE_BUFFER,
            Self::UniformBuffer => vk::DescriptorType::UNIFORM_BUFFER,
            Self::StorageImage => vk::DescriptorType::STORAGE_IMAGE,
            Self::SampledImage => vk::DescriptorType::SAMPLED_IMAGE,
            Self::ImageAndSampler => vk::DescriptorType::COMBINED_IMAGE_SAMPLER,
            Self::Sampler => vk::DescriptorType::SAMPLER,
            Self::AccelerationStructure => vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
        }
    }
}

/// One binding of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BindingInfo {
    /// Descriptor set.
    pub set: u32,
    /// Number in the set.
    pub binding: u32,
    /// Name in the source, where the SPIR-V has kept it.
    pub name: Option<String>,
    /// Kind of object.
    pub kind: BindingKind,
    /// True if declared without `readonly` (buffers, storage images).
    pub written: bool,
    /// 2 or 3 for images, else 0.
    pub image_dimensions: u32,
}

impl std::fmt::Display for BindingInfo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "binding {}", self.binding)?;
        if self.set != 0 {
            write!(f, " of set {}", self.set)?;
        }
        match &self.name {
            Some(name) if !name.is_empty() => write!(f, " ({name}, {:?})", self.kind),
            _ => write!(f, " ({:?})", self.kind),
        }
    }
}

/// Everything that the pipeline layout and the checks of a dispatch need.
#[derive(Debug)]
pub(crate) struct Reflection {
    pub(crate) entry_point: String,
    /// Sorted by set, then number.
    pub(crate) bindings: Vec<BindingInfo>,
    pub(crate) push_constant_bytes: u32,
    pub(crate) local_size: [u32; 3],
    /// True where gl_NumWorkGroups is read.
    pub(crate) counts_groups: bool,
    /// Shared memory of a work group, bytes.
    pub(crate) shared_bytes: u32,
}

/// Reads a compute module with one entry point; `specialization` gives (id, value as bits).
/// The error is a sentence without the kernel's name.
pub(crate) fn reflect(words: &[u32], specialization: &[(u32, u32)]) -> Result<Reflection, String> {
    // spirq panics on less than a header.
    if words.len() < 5 || words[0] != SPIRV_MAGIC {
        return Err("it is not SPIR-V".into());
    }
    let mut entries = ReflectConfig::new()
        .spv(words)
        .ref_all_rscs(true)
        .reflect()
        .map_err(|error| format!("its SPIR-V cannot be read: {error}"))?;
    let entry = match entries.len() {
        1 => entries.remove(0),
        n => return Err(format!("it has {n} entry points, one is needed")),
    };
    if entry.exec_model != ExecutionModel::GLCompute {
        return Err(format!("it is a {:?} shader, not compute", entry.exec_model));
    }
    let mut bindings = Vec::new();
    let mut push_constant_bytes = 0;
    let constants = SpecConstants::read(words, specialization);
    for (id, _) in specialization {
        if !constants.ids.contains(id) {
            return Err(format!("it has no specialization constant {id}"));
        }
    }
    for variable in &entry.vars {
        match variable {
            Variable::Descriptor { .. } => bindings.push(binding(variable)?),
            Variable::PushConstant { ty, .. } => {
                let bytes = ty.nbyte().ok_or("its push constants have no size")?;
                push_constant_bytes = u32::try_from(bytes).map_err(|e| e.to_string())?;
            }
            _ => {}
        }
    }
    bindings.sort_by_key(|b| (b.set, b.binding));
    if let Some(pair) = bindings
        .windows(2)
        .find(|pair| (pair[0].set, pair[0].binding) == (pair[1].set, pair[1].binding))
    {
        return Err(format!("{} is declared twice", pair[0]));
    }
    Ok(Reflection {
        entry_point: entry.name,
        bindings,
        push_constant_bytes,
        local_size: constants.local_size.ok_or("it states no work-group size")?,
        counts_groups: constants.counts_groups,
        shared_bytes: shared_bytes(words, &constants.value_of)?,
    })
}

fn binding(variable: &Variable) -> Result<BindingInfo, String> {
    let Variable::Descriptor { name, desc_bind, desc_ty, ty, nbind } = variable else {
        unreachable!("the caller passes descriptors only");
    };
    let at = format!("binding {desc_bind}");
    if *nbind != 1 {
        return Err(format!("{at} is an array of descriptors, which is not supported"));
    }
    let writes = |access: &AccessType| *access != AccessType::ReadOnly;
    let (kind, written) = match desc_ty {
        DescriptorType::StorageBuffer(access) => (BindingKind::StorageBuffer, writes(access)),
        DescriptorType::UniformBuffer() => (BindingKind::UniformBuffer, false),
        DescriptorType::StorageImage(access) => (BindingKind::StorageImage, writes(access)),
        DescriptorType::SampledImage() => (BindingKind::SampledImage, false),
        DescriptorType::CombinedImageSampler() => (BindingKind::ImageAndSampler, false),
        DescriptorType::Sampler() => (BindingKind::Sampler, false),
        DescriptorType::AccelStruct() => (BindingKind::AccelerationStructure, false),
        other => return Err(format!("{at} is a {other:?}, which is not supported")),
    };
    use spirq::ty::Dim;
    let dim = match ty {
        Type::StorageImage(image) => Some(image.dim),
        Type::SampledImage(image) => Some(image.dim),
        Type::CombinedImageSampler(image) => Some(image.sampled_image_ty.dim),
        _ => None,
    };
    let image_dimensions = match dim {
        None => 0,
        Some(Dim::Dim2D) => 2,
        Some(Dim::Dim3D) => 3,
        Some(other) => return Err(format!("{at} is an image of {other:?}, only 2D and 3D are")),
    };
    Ok(BindingInfo {
        set: desc_bind.set(),
        binding: desc_bind.bind(),
        name: name.clone().or_else(|| block_name(ty)),
        kind,
        written,
        image_dimensions,
    })
}

/// Name of a block. Blocks without an instance name are known by the block's own.
fn block_name(ty: &Type) -> Option<String> {
    match ty {
        Type::Struct(block) => block.name.clone(),
        _ => None,
    }
}

/// Constants as specialized, read from the words: spirq does not report the `WorkgroupSize`
/// built-in, which holds `local_size_x_id`.
#[derive(Default)]
struct SpecConstants {
    ids: Vec<u32>,
    local_size: Option<[u32; 3]>,
    counts_groups: bool,
    /// Values by id in the module.
    value_of: HashMap<u32, u32>,
}

impl SpecConstants {
    fn read(words: &[u32], specialization: &[(u32, u32)]) -> Self {
        const OP_EXECUTION_MODE: u32 = 16;
        const OP_CONSTANT: u32 = 43;
        const OP_CONSTANT_COMPOSITE: u32 = 44;
        const OP_SPEC_CONSTANT: u32 = 50;
        const OP_SPEC_CONSTANT_COMPOSITE: u32 = 51;
        const OP_DECORATE: u32 = 71;
        const OP_EXECUTION_MODE_ID: u32 = 331;
        const MODE_LOCAL_SIZE: u32 = 17;
        const MODE_LOCAL_SIZE_ID: u32 = 38;
        const DECORATION_SPEC_ID: u32 = 1;
        const DECORATION_BUILT_IN: u32 = 11;
        const BUILT_IN_NUM_WORKGROUPS: u32 = 24;
        const BUILT_IN_WORKGROUP_SIZE: u32 = 25;

        let mut constants = Self::default();
        let mut spec_id_of = HashMap::new();
        let mut size_ids = None;
        let mut size_object = None;
        let mut at = 5; // after the header
        while let Some(&first) = words.get(at) {
            let (length, op) = ((first >> 16) as usize, first & 0xffff);
            let Some(w) = words.get(at..at + length).filter(|w| !w.is_empty()) else {
                break;
            };
            match (op, w) {
                (OP_EXECUTION_MODE, &[_, _, MODE_LOCAL_SIZE, x, y, z]) => {
                    constants.local_size = Some([x, y, z]);
                }
                (OP_EXECUTION_MODE_ID, &[_, _, MODE_LOCAL_SIZE_ID, x, y, z]) => {
                    size_ids = Some([x, y, z]);
                }
                (OP_DECORATE, &[_, id, DECORATION_SPEC_ID, spec]) => {
                    constants.ids.push(spec);
                    spec_id_of.insert(id, spec);
                }
                (OP_DECORATE, &[_, _, DECORATION_BUILT_IN, BUILT_IN_NUM_WORKGROUPS]) => {
                    constants.counts_groups = true;
                }
                (OP_DECORATE, &[_, id, DECORATION_BUILT_IN, BUILT_IN_WORKGROUP_SIZE]) => {
                    size_object = Some(id);
                }
                (OP_CONSTANT | OP_SPEC_CONSTANT, &[_, _, id, value, ..]) => {
                    let chosen = spec_id_of.get(&id).and_then(|spec| {
                        specialization.iter().find(|(s, _)| s == spec).map(|s| s.1)
                    });
                    constants.value_of.insert(id, chosen.unwrap_or(value));
                }
                (OP_CONSTANT_COMPOSITE | OP_SPEC_CONSTANT_COMPOSITE, &[_, _, id, x, y, z])
                    if size_object == Some(id) =>
                {
                    size_ids = Some([x, y, z]);
                }
                _ => {}
            }
            at += length;
        }
        if let Some(ids) = size_ids {
            let size = ids.map(|id| constants.value_of.get(&id).copied().unwrap_or(0));
            constants.local_size = Some(size);
        }
        constants
    }
}
