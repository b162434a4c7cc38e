//! The Vulkan layer on its own: every test runs with validation and ends without a message.

use std::sync::Arc;

use insonify::gpu::{
    AddressMode, Binding, Buffer, BufferKind, Device, DeviceOptions, Filter, GpuError, Image,
    ImageDim, ImageFormat, Kernel, LoneDevice, Sampler, list_devices, lone_device,
    lone_test_device,
};

use crate::common::skip;
use crate::common::timestamps;

mod accel;
mod commands;
mod dynamic;
mod sheet;

/// Group size of `add.comp` in these tests; not its default.
const ADD_GROUP: u32 = 32;

/// Drops the device and fails if the layers have given a message by then, leaks included.
fn assert_clean(device: LoneDevice) {
    assert_eq!(Arc::strong_count(&device), 1, "drop what was made of the device first");
    let log = device.validation_log();
    drop(device);
    let messages = log.messages();
    assert!(messages.is_empty(), "validation: {messages:#?}");
}

fn words(spirv: &[u8]) -> Vec<u32> {
    bytemuck::pod_collect_to_vec(spirv)
}

/// A kernel for target = factor * source + value.
fn add_kernel(device: &Arc<Device>, factor: u32) -> Kernel {
    let spirv = words(include_bytes!("gpu/add.spv"));
    Kernel::new(device, "add", &spirv, &[(0, ADD_GROUP), (1, factor)]).unwrap()
}

fn buffer_of(device: &Arc<Device>, name: &str, values: &[u32]) -> Buffer {
    let bytes = bytemuck::cast_slice(values);
    let buffer = device.buffer(name, bytes.len() as u64, BufferKind::Storage).unwrap();
    device.upload(&buffer, bytes).unwrap();
    buffer
}

#[test]
fn devices_are_listed_with_what_they_lack() {
    let devices = list_devices().unwrap().devices;
    assert!(!devices.is_empty());
    for (index, device) in devices.iter().enumerate() {
        assert_eq!(device.index, index);
        assert!(!device.name.is_empty() && !device.driver.is_empty());
        assert!(device.memory_bytes > 0);
        assert!(!device.ray_query || device.acceleration_structure);
        let says_so = device.lacks.iter().any(|l| l.contains("ray quer"));
        assert_eq!(says_so, device.acceleration_structure && !device.ray_query, "{device:?}");
    }
}

#[test]
fn an_unknown_device_is_answered_with_the_list() {
    for selector in ["no such adapter", "99"] {
        let options = DeviceOptions { selector: Some(selector.into()), ..Default::default() };
        let error = lone_device(&options).err().expect("no device is called so");
        let text = error.to_string();
        assert!(matches!(error, GpuError::UnknownDevice { .. }));
        assert!(text.contains(selector), "{text}");
        for device in list_devices().unwrap().devices {
            assert!(text.contains(&device.name), "{text}");
        }
    }
}

#[test]
fn a_device_is_chosen_by_index_or_part_of_its_name() {
    let first = list_devices().unwrap().devices.remove(0);
    let part = first.name[1..].to_uppercase();
    for selector in ["0".to_owned(), part] {
        let options = DeviceOptions { selector: Some(selector), ..Default::default() };
        assert_eq!(lone_device(&options).unwrap().name(), first.name);
    }
}

#[test]
fn uploads_read_back_and_memory_is_counted_and_returned() {
    let device = lone_test_device();
    let before = device.memory().current;
    let a = device.buffer("a", 4000, BufferKind::Storage).unwrap();
    let b = device.buffer("b", 10, BufferKind::Storage).unwrap();
    assert_eq!(b.size(), 12, "rounded up to whole words");
    assert!(device.memory().current >= before + 4012);
    let bytes: Vec<u8> = (0..4000).map(|i| (i * 7 % 251) as u8).collect();
    device
        .upload_many(&[(&a, 0, &bytes[..1000]), (&b, 4, &[9; 8]), (&a, 1000, &bytes[1000..])])
        .unwrap();
    assert_eq!(device.read_back(&a).unwrap(), bytes);
    assert_eq!(device.read_back(&b).unwrap()[4..], [9; 8]);
    let mut piece = [0; 5];
    device.read_into(&a, 501, &mut piece).unwrap();
    assert_eq!(piece, bytes[501..506]);

    let error = device.upload(&b, &[0; 13]).unwrap_err();
    assert!(error.to_string().contains("upload of 'b': bytes 0..13 of 12"));
    let error = device.read_into(&a, 3999, &mut piece).unwrap_err();
    assert!(matches!(error, GpuError::OutOfBounds { end: 4004, .. }));
    drop((a, b));
    assert_eq!(device.memory().current, before);
    assert!(device.memory().peak >= before + 8012, "staging counts too");
    assert_clean(device);
}

#[test]
fn uploads_larger_than_the_staging_memory_arrive_whole() {
    let device = lone_test_device();
    let count = (33 << 20) / 4 + 3; // beyond the 32 MiB of one submission
    let values: Vec<u32> = (0..count).map(|i: u32| i.wrapping_mul(2654435761)).collect();
    let buffer = buffer_of(&device, "large", &values);
    assert!(device.read_back_as::<u32>(&buffer).unwrap() == values);
    drop(buffer);
    assert_clean(device);
}

#[test]
fn a_buffer_beyond_the_limit_is_refused_with_the_limit() {
    let device = lone_test_device();
    let limit = device.limits().max_storage_buffer_bytes;
    let error = device.buffer("echoes", limit + 4, BufferKind::Storage).err().expect("too large");
    let text = error.to_string();
    assert!(text.contains("'echoes'") && text.contains(&limit.to_string()), "{text}");
    assert_clean(device);
}

#[test]
fn a_kernel_is_reflected_and_specialized() {
    let device = lone_test_device();
    let kernel = add_kernel(&device, 3);
    assert_eq!(kernel.local_size(), [ADD_GROUP, 1, 1]);
    assert_eq!(kernel.push_constant_bytes(), 8);
    let written: Vec<_> = kernel.bindings().iter().map(|b| (b.binding, b.written)).collect();
    assert_eq!(written, [(0, false), (1, true)]);

    let source: Vec<u32> = (0..1001).collect();
    let a = buffer_of(&device, "a", &source);
    let b = buffer_of(&device, "b", &vec![7; 1003]);
    device
        .once(|commands| {
            let bindings = [Binding::Buffer(&a), Binding::Buffer(&b)];
            let push = [1001, 5_u32];
            commands.dispatch(&kernel, [1001, 1, 1], bytemuck::bytes_of(&push), &bindings)
        })
        .unwrap();
    let mut expected: Vec<u32> = source.iter().map(|x| 3 * x + 5).collect();
    expected.extend([7, 7]);
    assert_eq!(device.read_back_as::<u32>(&b).unwrap(), expected);

    let spirv = words(include_bytes!("gpu/add.spv"));
    let error = Kernel::new(&device, "add", &spirv, &[(9, 1)]).err().unwrap();
    assert!(error.to_string().contains("no specialization constant 9"), "{error}");
    let error = Kernel::new(&device, "add", &spirv, &[(0, 1 << 20)]).err().unwrap();
    assert!(error.to_string().contains("work group"), "{error}");
    let error = Kernel::new(&device, "noise", &[1, 2, 3], &[]).err().unwrap();
    assert!(error.to_string().contains("'noise'"), "{error}");
    drop((kernel, a, b));
    assert_clean(device);
}

#[test]
fn a_dispatch_that_does_not_fit_its_kernel_is_refused_by_name() {
    let device = lone_test_device();
    let kernel = add_kernel(&device, 1);
    let a = buffer_of(&device, "a", &[1]);
    let sampler = Sampler::new(&device, "s", Filter::Nearest, AddressMode::ClampToEdge).unwrap();
    let both = [Binding::Buffer(&a), Binding::Buffer(&a)];
    let refused = |groups, push: &[u8], bindings: &[Binding<'_>]| {
        device
            .once(|commands| commands.dispatch_groups(&kernel, groups, push, bindings))
            .unwrap_err()
    };
    let error = refused([1, 1, 1], &[0; 8], &both[..1]);
    let text = error.to_string();
    assert!(text.contains("'add', 1 bindings: it has 2"), "{text}");

    let error = refused([1, 1, 1], &[0; 8], &[both[0], Binding::Sampler(&sampler)]);
    let text = error.to_string();
    assert!(matches!(error, GpuError::Binding { .. }), "{text}");
    assert!(text.contains("binding 1") && text.contains("a sampler was given"), "{text}");

    let error = refused([1, 1, 1], &[0; 12], &both);
    assert!(matches!(error, GpuError::PushConstants { expected: 8, given: 12, .. }));

    let beyond = device.limits().max_group_count[1].saturating_add(1);
    if beyond > device.limits().max_group_count[1] {
        let error = refused([1, beyond, 1], &[0; 8], &both);
        assert!(matches!(error, GpuError::GroupCount { .. }));
    }
    drop((kernel, a, sampler));
    assert_clean(device);
}

/// A volume and a plane with linear ramps are read between their texels, the sum is written.
#[test]
fn images_are_uploaded_sampled_written_and_read_back() {
    let device = lone_test_device();
    let spirv = words(include_bytes!("gpu/sample.spv"));
    let kernel = Kernel::new(&device, "sample", &spirv, &[]).unwrap();
    let image =
        |name, dim, extent| Image::new(&device, name, dim, extent, ImageFormat::R32Float).unwrap();
    let volume = image("volume", ImageDim::D3, [4, 2, 2]);
    let plane = image("plane", ImageDim::D2, [2, 2, 1]);
    let result = image("result", ImageDim::D2, [7, 5, 1]);
    let linear = Sampler::new(&device, "linear", Filter::Linear, AddressMode::ClampToEdge);
    let linear = linear.unwrap();
    // Ramp along x, with the mean of the two layers read halfway between them.
    let layer = |add: f32| (0..8).map(move |i| (i % 4) as f32 + add);
    let texels: Vec<f32> = layer(0.0).chain(layer(2.0)).collect();
    device.upload_image(&volume, bytemuck::cast_slice(&texels)).unwrap();
    device.upload_image(&plane, bytemuck::cast_slice(&[0.0_f32, 0.0, 8.0, 8.0])).unwrap();
    assert_eq!(volume.read_back().unwrap(), bytemuck::cast_slice::<f32, u8>(&texels));
    let bindings = [
        Binding::Image(&volume),
        Binding::Sampler(&linear),
        Binding::Sampled(&plane, &linear),
        Binding::Image(&result),
    ];
    device.once(|commands| commands.dispatch(&kernel, [7, 5, 1], &[], &bindings)).unwrap();
    let bytes = result.read_back().unwrap();
    let got: &[f32] = bytemuck::cast_slice(&bytes);
    for (at, &value) in got.iter().enumerate() {
        let (u, v) = (((at % 7) as f32 + 0.5) / 7.0, ((at / 7) as f32 + 0.5) / 5.0);
        let ramp = (4.0 * u - 0.5).clamp(0.0, 3.0) + 1.0;
        let plane = 8.0 * (2.0 * v - 0.5).clamp(0.0, 1.0);
        // Filter weights have at least 8 fractional bits (Vulkan's limit of 4 is met by no
        // device in use), on steps of at most 8.
        assert!((value - ramp - plane).abs() < 9.0 / 256.0, "{at}: {value} {ramp} {plane}");
    }

    let swapped = [bindings[2], bindings[1], bindings[0], bindings[3]];
    let error = device.once(|c| c.dispatch(&kernel, [7, 5, 1], &[], &swapped)).unwrap_err();
    assert!(error.to_string().contains("binding 0"), "{error}");
    let flat = [Binding::Image(&plane), bindings[1], bindings[2], bindings[3]];
    let error = device.once(|c| c.dispatch(&kernel, [7, 5, 1], &[], &flat)).unwrap_err();
    assert!(error.to_string().contains("2 axes, the kernel's has 3"), "{error}");
    assert!(device.upload_image(&plane, &[0; 15]).is_err());
    drop((kernel, volume, plane, result, linear));
    assert_clean(device);
}
