//! GLSL to validated SPIR-V by shaderc (feature `compile`).

use std::path::Path;

use shaderc::{
    CompileOptions, EnvVersion, OptimizationLevel, ResolvedInclude, ShaderKind, TargetEnv,
};

use super::source::{self, Variant};
use super::{Error, bytes_of, validate};

/// Compiles one variant of the kernels in `dir`; warnings are errors. The module has passed naga
/// (not the ray-query ones, which it cannot read) and, where installed, spirv-val.
pub fn compile(dir: &Path, variant: &Variant) -> Result<Vec<u32>, Error> {
    let failed = |message: String| Error::Compile {
        stem: variant.stem.clone(),
        message: message.trim().to_owned(),
    };
    let files = source::files(dir, &variant.file)?;
    let compiler = shaderc::Compiler::new().map_err(|e| failed(e.to_string()))?;
    let mut options = CompileOptions::new().map_err(|e| failed(e.to_string()))?;
    let version = if variant.ray_query() { EnvVersion::Vulkan1_2 } else { EnvVersion::Vulkan1_1 };
    options.set_target_env(TargetEnv::Vulkan, version as u32);
    options.set_optimization_level(if variant.keep_names {
        OptimizationLevel::Zero
    } else {
        OptimizationLevel::Performance
    });
    options.set_warnings_as_errors();
    for define in &variant.defines {
        options.add_macro_definition(define, None);
    }
    options.set_include_callback(|name, _, from, _| match files.get(name) {
        Some(text) => Ok(ResolvedInclude { resolved_name: name.to_owned(), content: text.clone() }),
        None => Err(format!("{from} includes {name}, which is not in {}", dir.display())),
    });
    let artifact = compiler
        .compile_into_spirv(
            &files[&variant.file],
            ShaderKind::Compute,
            &variant.file,
            "main",
            Some(&options),
        )
        .map_err(|e| failed(e.to_string()))?;
    let words = artifact.as_binary().to_vec();
    let bytes = bytes_of(&words);
    if !variant.ray_query() {
        validate::naga(&variant.stem, &bytes)?;
    }
    validate::spirv_val(&variant.stem, &bytes, variant.target())?;
    Ok(words)
}
