use super::*;

fn acquired(size: [usize; 3], voxels: Voxels) -> Acquired {
    Acquired {
        size,
        volumes: vec![Arc::new(voxels)],
        now: 0,
        sequence: None,
        world_from_voxel: DAffine3::IDENTITY,
        world_from_lps: DAffine3::IDENTITY,
        black: 0.0,
        white: 1.0,
    }
}

#[test]
fn blocks_keep_to_the_limit_and_the_budget() {
    let volume = |size| acquired(size, Voxels::U16(Vec::new()));
    assert_eq!(block(&volume([100, 50, 20]), 100, 200_000), [1, 1, 1]);
    assert_eq!(block(&volume([101, 50, 20]), 100, 300_000), [2, 1, 1]);
    assert_eq!(block(&volume([100, 50, 20]), 100, 199_999), [2, 1, 1]);
    assert_eq!(block(&volume([100, 50, 20]), 100, 50_000), [2, 2, 1]);
    // Two times of a volume share the budget: each has half of it.
    let mut twice = volume([100, 50, 20]);
    twice.volumes.push(Arc::new(Voxels::U16(Vec::new())));
    assert_eq!(block(&twice, 100, 400_000), [1, 1, 1]);
    assert_eq!(block(&twice, 100, 399_999), [2, 1, 1]);
}

// A linear function: the mean of a block is its value in the middle of the block, which is where the
// texel must lie.
#[test]
fn a_coarser_linear_function_is_the_same_function() {
    let size = [9, 8, 6];
    let value = |p: [usize; 3]| p[0] as f32 + 10.0 * p[1] as f32 + 100.0 * p[2] as f32;
    let places = (0..9 * 8 * 6).map(|i| [i % 9, i / 9 % 8, i / 72]);
    let volume = acquired(size, Voxels::F32(places.map(value).collect()));
    let block = [3, 2, 1];
    let coarse = average(volume.voxels(), size, block, [3, 4, 6]);
    let step = DVec3::from(block.map(|n| n as f64));
    for (i, at) in (0..3 * 4 * 6).map(|i| (i, [i % 3, i / 3 % 4, i / 12])) {
        let p = DVec3::from(at.map(|n| n as f64)) * step + (step - 1.0) / 2.0;
        let expected = p.dot(DVec3::new(1.0, 10.0, 100.0));
        assert!((coarse.get(i) - expected).abs() < 1e-4, "{at:?}");
    }
}

// Signed values are shifted into unsigned texels and back.
#[test]
fn texels_stand_for_the_stored_values() {
    let eight = Voxels::I8(vec![-128, -1, 0, 127]);
    let sixteen = Voxels::I16(vec![-32768, -1, 0, 32767]);
    for voxels in [eight, sixteen] {
        let made = texels(&voxels, &acquired([4, 1, 1], voxels.clone()));
        let wide = made.format == ImageFormat::R16Unorm;
        for i in 0..4 {
            let stored = match wide {
                true => f64::from(u16::from_le_bytes([made.bytes[2 * i], made.bytes[2 * i + 1]])),
                false => f64::from(made.bytes[i]),
            };
            assert_eq!(stored + made.offset, voxels.get(i));
        }
        assert_eq!(made.scale, if wide { 65535.0 } else { 255.0 });
    }
}
