//! Files of kept pipelines: whole, broken, foreign, too many.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use ash::vk;

use super::{MAX_FILES, decode, encode, file_name, is_of, read, write};
use crate::{Binding, BufferKind, DeviceOptions, Frames, Kernel, LoneDevice, lone_device};

fn properties() -> vk::PhysicalDeviceProperties {
    vk::PhysicalDeviceProperties {
        vendor_id: 0x10de,
        device_id: 0x2335,
        driver_version: 7,
        pipeline_cache_uuid: [0xab; 16],
        ..Default::default()
    }
}

/// A pipeline cache's header for that device, and some bytes after it.
fn data() -> Vec<u8> {
    let mut out = Vec::new();
    for word in [32, 1, 0x10de, 0x2335u32] {
        out.extend(word.to_le_bytes());
    }
    out.extend([0xab; 16]);
    out.extend([1, 2, 3]);
    out
}

#[test]
fn written_files_are_read_again_and_broken_files_are_not() {
    let known = BTreeSet::from([3, u64::MAX, 17]);
    let bytes = encode(&known, &data());
    assert_eq!(decode(&bytes), Some((known, data())));
    for cut in 0..bytes.len() {
        assert_eq!(decode(&bytes[..cut]), None, "cut at {cut}");
    }
    for at in 0..bytes.len() {
        let mut bent = bytes.clone();
        bent[at] ^= 4;
        assert_eq!(decode(&bent), None, "bent at {at}");
    }
}

#[test]
fn a_foreign_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (mine, mut other) = (properties(), properties());
    let file = folder.path().join(file_name(&mine));
    assert_eq!(read(&file, &mine), Ok(None), "no file");
    write(&file, &encode(&BTreeSet::from([1]), &data())).unwrap();
    assert!(read(&file, &mine).unwrap().is_some());
    other.pipeline_cache_uuid[3] = 0;
    assert_ne!(file_name(&other), file_name(&mine));
    let refused = read(&file, &other).unwrap_err();
    assert!(refused.contains("another device"), "{refused}");
    assert!(!is_of(&data()[..20], &mine), "less than a header");
    fs::write(&file, b"not one of these").unwrap();
    assert!(read(&file, &mine).unwrap_err().contains("broken"));
}

#[test]
fn files_do_not_become_more_and_more() {
    let folder = tempfile::tempdir().unwrap();
    for version in 0..20 {
        let properties = vk::PhysicalDeviceProperties { driver_version: version, ..properties() };
        let file = folder.path().join(file_name(&properties));
        write(&file, &encode(&BTreeSet::new(), &[])).unwrap();
        assert!(file.exists(), "the newest stays");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), MAX_FILES);
}

fn device(folder: &Path) -> LoneDevice {
    lone_device(&DeviceOptions {
        validate: true,
        kept_in: Some(folder.to_owned()),
        ..Default::default()
    })
    .unwrap()
}

fn assert_clean(device: LoneDevice) {
    let log = device.validation_log();
    drop(device);
    assert_eq!(log.messages(), [""; 0]);
}

#[test]
fn a_kernel_that_has_run_is_known_at_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let spirv: Vec<u32> =
        bytemuck::pod_collect_to_vec(include_bytes!("../../../tests/gpu/add.spv"));
    let kernel = |device: &LoneDevice, factor: u32| {
        Kernel::new(device, "add", &spirv, &[(0, 32), (1, factor)]).unwrap()
    };
    let first = device(folder.path());
    let add = kernel(&first, 3);
    let id = add.0.pipeline.id;
    assert!(first.kept.is_new(id));
    let [source, target] =
        ["source", "target"].map(|name| first.buffer(name, 128, BufferKind::Storage).unwrap());
    let mut frames = Frames::new(&first, "test").unwrap();
    let mut commands = frames.begin().unwrap();
    commands.scope("add");
    let bindings = [Binding::Buffer(&source), Binding::Buffer(&target)];
    let push = vec![0; add.push_constant_bytes()];
    commands.dispatch(&add, [32, 1, 1], &push, &bindings).unwrap();
    commands.submit().unwrap();
    assert!(first.kept.is_new(id), "it has not finished");
    frames.wait().unwrap();
    assert!(!first.kept.is_new(id));
    drop((add, source, target, frames));
    assert_clean(first);

    let second = device(folder.path());
    assert!(!second.kept.is_new(kernel(&second, 3).0.pipeline.id));
    assert!(second.kept.is_new(kernel(&second, 4).0.pipeline.id), "another constant");
    assert_clean(second);
    let [file] = &fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect::<Vec<_>>()[..]
    else {
        panic!("one file, and nothing half written");
    };
    fs::write(file, b"insonify pipelines 1\nnonsense").unwrap();
    let third = device(folder.path());
    assert!(third.kept.is_new(id), "a broken file says nothing");
    assert_clean(third);
}
