use ash::vk;

use super::{QueueUser, SubmissionSlot};
use crate::skip::{Lacking, skip};
use crate::{Commands, GpuError, lone_test_device, test_device};

#[test]
fn stages_in_many_batches_are_timed_and_so_is_what_follows() {
    let device = lone_test_device();
    let mut slot = SubmissionSlot::new(&device, "test", QueueUser::Work).unwrap();
    let mut commands = Commands::begin(&mut slot, 0).unwrap();
    for _ in 0..4096 {
        commands.scope("trace");
        commands.scope("scatter");
    }
    commands.scope("beam");
    drop(commands);
    slot.submit(0).unwrap();
    // SAFETY: the device is alive.
    unsafe { device.raw.device_wait_idle() }.unwrap();
    let times = slot.timer.collect().unwrap();
    assert!(device.validation_messages().is_empty());
    if device.timestamp_bits == 0 {
        assert_eq!(times, []);
        return skip(Lacking::Tool, &format!("'{}' has no timestamps", device.name()));
    }
    let [trace, beam] = ["trace", "beam"].map(|n| times.iter().filter(|t| t.0 == n).count());
    assert!(trace > 100 && beam == 1, "{trace} {beam}");
}

/// No driver at hand can be made to lose its device, so the code is planted.
#[test]
fn a_lost_device_names_the_last_pass_that_began() {
    let device = lone_test_device();
    let mut slot = SubmissionSlot::new(&device, "test", QueueUser::Work).unwrap();
    let mut commands = Commands::begin(&mut slot, 0).unwrap();
    commands.scope("trace");
    commands.scope("scatter");
    drop(commands);
    let lost = vk::Result::ERROR_DEVICE_LOST;
    let text = slot.failure(lost, "waiting").to_string();
    assert!(text.contains("'none'") && text.contains("trace, scatter"), "{text}");

    slot.submit(0).unwrap();
    // SAFETY: the device is alive.
    unsafe { device.raw.device_wait_idle() }.unwrap();
    let text = slot.failure(lost, "waiting").to_string();
    assert!(text.contains("ERROR_DEVICE_LOST") && text.contains("'scatter'"), "{text}");
    let other = slot.failure(vk::Result::ERROR_OUT_OF_HOST_MEMORY, "waiting");
    let kept = vk::Result::ERROR_OUT_OF_HOST_MEMORY;
    assert!(matches!(other, GpuError::Vulkan { code, .. } if code == kept));
    assert!(device.validation_messages().is_empty());
}

/// The layers of Debian 12 die here within seconds where regions are labelled while they validate.
#[test]
fn slots_are_made_and_dropped_beside_each_other() {
    let device = test_device();
    std::thread::scope(|threads| {
        for _ in 0..4 {
            threads.spawn(|| {
                for _ in 0..400 {
                    let mut slot = SubmissionSlot::new(&device, "test", QueueUser::Work).unwrap();
                    let mut commands = Commands::begin(&mut slot, 0).unwrap();
                    commands.scope("trace");
                }
            });
        }
    });
}
