//! The shaders as Metal and DirectX 12 get them. No such driver is needed: wgpu
//! hands them Naga's translations, and these are made here for every entry point,
//! with the options that wgpu gives.

use crate::render::gpu::{SCREEN_SPACE, SHADER, TRACE, TRACE_QUERY, composite, loaded, raster};
use naga::{
    Module, ShaderStage,
    back::{PipelineConstants, hlsl, msl, pipeline_constants::process_overrides},
    valid::{Capabilities, ModuleInfo, ValidationFlags, Validator},
};
use std::{borrow::Cow, fs, path::Path, process::Command};

/// Every shader that kernels are compiled from.
fn shaders() -> Vec<(String, String)> {
    let alone = [("screen_space", SCREEN_SPACE), ("temporal", loaded::TEMPORAL), ("atrous", loaded::ATROUS)];
    let mut all: Vec<_> = alone.map(|(name, text)| (name.to_owned(), text.to_owned())).into();
    for (by, trace) in [("software", TRACE), ("ray_query", TRACE_QUERY)] {
        for (name, text) in [("ao", SHADER), ("composite", composite::SHADER), ("raster", raster::SHADER)] {
            all.push((format!("{name}.{by}"), [trace, text].concat()));
        }
    }
    all
}

fn parsed(name: &str, text: &str) -> (Module, ModuleInfo) {
    let mut options = naga::front::wgsl::Options::new();
    options.capabilities = Capabilities::all();
    let module = naga::front::wgsl::Frontend::new_with_options(options).parse(text);
    let module = module.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
    (module, info.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text))))
}

/// One entry point of a shader, its constants as they are by default.
struct Entry<'a> {
    name: &'a str,
    stage: ShaderStage,
    by_query: bool,
    module: Cow<'a, Module>,
    info: Cow<'a, ModuleInfo>,
}

impl Entry<'_> {
    /// Metal's language, in the version that ray query came with.
    fn metal(&self) -> String {
        let options = msl::Options { lang_version: (2, 4), fake_missing_bindings: true, ..Default::default() };
        let entry = Some((self.stage, self.name.to_owned()));
        let pipeline = msl::PipelineOptions { entry_point: entry, ..Default::default() };
        let (text, told) = msl::write_string(&self.module, &self.info, &options, &pipeline).unwrap();
        assert!(told.entry_point_names.iter().all(Result::is_ok), "{}", self.name);
        text
    }

    /// DirectX 12's: shader model 6.0 for DXC, 5.1 for the compiler that is part of
    /// Windows, 6.5 for ray query.
    fn directx(&self, shader_model: hlsl::ShaderModel) -> String {
        let options = hlsl::Options {
            shader_model,
            fake_missing_bindings: true,
            // How it is written, glslang does not read. It changes nothing else.
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        };
        let pipeline = hlsl::PipelineOptions { entry_point: Some((self.stage, self.name.to_owned())) };
        let mut text = String::new();
        let told = hlsl::Writer::new(&mut text, &options, &pipeline).write(&self.module, &self.info, None).unwrap();
        assert!(told.entry_point_names.iter().all(Result::is_ok), "{}", self.name);
        text
    }

    fn shader_models(&self) -> Vec<hlsl::ShaderModel> {
        match self.by_query {
            true => vec![hlsl::ShaderModel::V6_5],
            false => vec![hlsl::ShaderModel::V5_1, hlsl::ShaderModel::V6_0],
        }
    }
}

/// Calls `with` for every entry point of every shader.
fn each_entry(mut with: impl FnMut(&str, &Entry<'_>)) {
    for (shader, text) in shaders() {
        let (module, info) = parsed(&shader, &text);
        for entry in &module.entry_points {
            let chosen = Some((entry.stage, entry.name.as_str()));
            let (module, info) = process_overrides(&module, &info, chosen, &PipelineConstants::default()).unwrap();
            let by_query = text.starts_with(TRACE_QUERY);
            with(&shader, &Entry { name: &entry.name, stage: entry.stage, by_query, module, info });
        }
    }
}

#[test]
fn no_shader_is_left_out() {
    let all = shaders();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/render/gpu/shaders");
    let mut files = 0;
    for file in fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        assert!(all.iter().any(|(_, whole)| whole.contains(&text)), "{}", path.display());
        files += 1;
    }
    assert!(files > 15);
}

#[test]
fn each_entry_point_is_translated_for_metal_and_directx() {
    let mut seen = Vec::new();
    each_entry(|shader, entry| {
        let metal = entry.metal();
        assert_eq!(metal.contains("intersection_query"), entry.by_query && metal.contains("acceleration_structure"));
        for model in entry.shader_models() {
            let text = entry.directx(model);
            assert!(text.contains(entry.name), "{shader}: {}", entry.name);
            // Direct3D gives a workgroup 32 KiB at most, Metal likewise on most devices.
            if text.contains("groupshared") {
                assert!(text.contains("groupshared uint2 stacks[1536];"), "{shader}: {}", entry.name);
            }
        }
        seen.push(entry.name.to_owned());
    });
    for name in ["see", "openness", "indirect", "shade", "resolve", "project", "show"] {
        assert_eq!(seen.iter().filter(|s| *s == name).count() % 2, 0, "{name} by both kinds of rays: {seen:?}");
        assert!(seen.iter().any(|s| s == name), "{name}: {seen:?}");
    }
}

/// A compiler that is not of this house reads what DirectX 12 gets.
#[test]
#[ignore = "needs glslangValidator and spirv-val: .ci/peers shaders"]
fn glslang_compiles_what_directx_gets() {
    let folder = tempfile::tempdir().unwrap();
    let mut compiled = 0;
    each_entry(|shader, entry| {
        if entry.by_query {
            return; // glslang's HLSL has no ray query.
        }
        let stage = match entry.stage {
            ShaderStage::Vertex => "vert",
            ShaderStage::Fragment => "frag",
            _ => "comp",
        };
        for model in entry.shader_models() {
            let [text, binary] = ["hlsl", "spv"].map(|kind| folder.path().join(format!("shader.{kind}")));
            fs::write(&text, entry.directx(model)).unwrap();
            let mut glslang = Command::new("glslangValidator");
            glslang.args(["-D", "-V", "-S", stage, "-e", entry.name, "-o"]).args([&binary, &text]);
            for command in [&mut glslang, Command::new("spirv-val").arg(&binary)] {
                let told = command.output().unwrap();
                let said = String::from_utf8_lossy(&told.stdout);
                assert!(told.status.success(), "{shader}, {}, {model:?}: {said}", entry.name);
            }
            compiled += 1;
        }
        println!("{shader}: {} compiles as HLSL", entry.name);
    });
    assert!(compiled >= 20, "{compiled}");
}
