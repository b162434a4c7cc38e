//! Frames in flight, their times, and the barriers between their commands.

use std::sync::Arc;

use insonify::gpu::{Binding, Buffer, BufferKind, Device, Frames, Stage, lone_test_device};

use super::timestamps::timestamps;
use super::{add_kernel, assert_clean, buffer_of};

#[test]
fn two_frames_in_flight_keep_their_own_parameters_and_times() {
    let device = lone_test_device();
    let kernel = add_kernel(&device, 1);
    let count = 10_000;
    let parameter = device.buffer("parameter", 4 * count, BufferKind::Storage).unwrap();
    let sums: Vec<Buffer> = (0..6).map(|_| buffer_of(&device, "sum", &vec![0; 10_000])).collect();
    let mut frames = Frames::new(&device, "frame").unwrap();
    let mut timings = Vec::new();
    for (frame, sum) in sums.iter().enumerate() {
        assert_eq!(frames.next_frame(), frame as u64);
        let mut commands = frames.begin().unwrap();
        commands.scope("write");
        let values = vec![100 * frame as u32; count as usize];
        commands.write(&parameter, 0, bytemuck::cast_slice(&values)).unwrap();
        commands.barrier(Stage::Transfer, Stage::Compute);
        commands.scope("add");
        let push = [count as u32, frame as u32];
        let bindings = [Binding::Buffer(&parameter), Binding::Buffer(sum)];
        commands
            .dispatch(&kernel, [count as u32, 1, 1], bytemuck::bytes_of(&push), &bindings)
            .unwrap();
        commands.submit().unwrap();
        timings.extend(frames.take_timings());
        assert!(timings.len() <= frame, "no frame is waited for before the one after it");
    }
    frames.wait().unwrap();
    timings.extend(frames.take_timings());
    for (frame, sum) in sums.iter().enumerate() {
        let values = device.read_back_as::<u32>(sum).unwrap();
        assert!(values.iter().all(|&v| v == 101 * frame as u32), "frame {frame}");
    }
    let order: Vec<u64> = timings.iter().map(|t| t.frame).collect();
    assert_eq!(order, [0, 1, 2, 3, 4, 5]);
    if timestamps(&device) {
        for timing in &timings {
            let names: Vec<_> = timing.passes.iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, ["write", "add"]);
            // 10 s is far beyond any of it: a wrong period or bit mask would exceed it.
            assert!(timing.passes.iter().all(|&(_, ms)| ms > 0.0 && ms < 1e4), "{timing:?}");
            assert!(timing.total_ms() >= timing.passes[1].1);
        }
    }
    drop((frames, kernel, parameter, sums));
    assert_clean(device);
}

#[test]
fn objects_of_a_submission_may_be_dropped_before_it_has_run() {
    let device = lone_test_device();
    let mut frames = Frames::new(&device, "frame").unwrap();
    let b = buffer_of(&device, "b", &[0; 4096]);
    let mut commands = frames.begin().unwrap();
    {
        let kernel = add_kernel(&device, 2);
        let a = buffer_of(&device, "a", &[21; 4096]);
        let bindings = [Binding::Buffer(&a), Binding::Buffer(&b)];
        let push = [4096, 0_u32];
        commands.dispatch(&kernel, [4096, 1, 1], bytemuck::bytes_of(&push), &bindings).unwrap();
    }
    commands.submit().unwrap();
    assert_eq!(device.read_back_as::<u32>(&b).unwrap(), vec![42; 4096]);
    drop((frames, b));
    assert_clean(device);
}

/// Runs a -> b, then `from` -> `to` (of a, b, c), with or without the barrier between; returns c.
fn two_dispatches(device: &Arc<Device>, from: usize, to: usize, barrier: bool) -> Vec<u32> {
    let kernel = add_kernel(device, 1);
    let count = 1 << 16;
    let all = ["a", "b", "c"].map(|name| buffer_of(device, name, &vec![1; count]));
    let push = [count as u32, 1_u32];
    let push = bytemuck::bytes_of(&push);
    device
        .once(|commands| {
            let threads = [count as u32, 1, 1];
            let bind = |from: usize, to: usize| [&all[from], &all[to]].map(Binding::Buffer);
            commands.scope("first");
            commands.dispatch(&kernel, threads, push, &bind(0, 1))?;
            if barrier {
                commands.barrier(Stage::Compute, Stage::Compute);
            }
            commands.scope("second");
            commands.dispatch(&kernel, threads, push, &bind(from, to))
        })
        .unwrap();
    device.read_back_as(&all[2]).unwrap()
}

#[test]
fn a_barrier_between_dispatches_is_enough() {
    let device = lone_test_device();
    assert!(two_dispatches(&device, 1, 2, true).iter().all(|&v| v == 3));
    two_dispatches(&device, 2, 1, true);
    two_dispatches(&device, 1, 0, true);
    // Two dispatches that share only what they read need none.
    assert!(two_dispatches(&device, 0, 2, false).iter().all(|&v| v == 2));
    assert_clean(device);
}

/// A software driver gets the right result by luck and the layers do not see every case, hence the check
/// from the bindings.
#[test]
fn a_missing_barrier_between_dispatches_is_reported() {
    let cases = [
        (1, 2, "'second/add' reads 'b' that 'first/add' writes"),
        (2, 1, "'second/add' writes 'b' that 'first/add' writes"),
        (2, 0, "'second/add' writes 'a' that 'first/add' reads"),
    ];
    for (from, to, expected) in cases {
        let device = lone_test_device();
        two_dispatches(&device, from, to, false);
        let messages = device.validation_messages();
        assert!(messages.iter().any(|m| m.contains(expected)), "{messages:#?}");
    }
}

/// The layers themselves work: a fill read by a dispatch without a barrier.
#[test]
fn the_layers_report_a_deliberate_mistake() {
    let device = lone_test_device();
    let kernel = add_kernel(&device, 1);
    let [a, b] = ["a", "b"].map(|name| buffer_of(&device, name, &[1; 64]));
    device
        .once(|commands| {
            commands.fill(&a, 5);
            let bindings = [Binding::Buffer(&a), Binding::Buffer(&b)];
            commands.dispatch(&kernel, [64, 1, 1], bytemuck::bytes_of(&[64, 0_u32]), &bindings)
        })
        .unwrap();
    let messages = device.validation_messages();
    let by_layers = messages.iter().any(|m| m.contains("SYNC-HAZARD-READ-AFTER-WRITE"));
    let by_bindings = messages.iter().any(|m| m.starts_with("HAZARD"));
    assert!(by_layers && by_bindings, "{messages:#?}");
}
