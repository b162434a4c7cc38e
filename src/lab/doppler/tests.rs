use super::*;

#[test]
fn the_nyquist_velocity_turns_by_half_a_turn_between_pulses() {
    // Of c = 1.54 mm/us at 5 MHz and 4000 pulses a second.
    let probe = Probe { frequency: 5.0, ..Probe::linear() };
    assert!((nyquist(&probe, 4000.0) - 1.54e6 * 4000.0 / (4.0 * 5e6)).abs() < 1e-9);
}

#[test]
fn the_box_is_within_the_image() {
    let probe = Probe::linear();
    let whole = Doppler { left: 0.0, right: 1.0, top: 0.0, bottom: 1.0, ..Doppler::default() };
    let made = packet(&probe, &whole);
    assert_eq!((made.lines, made.samples), (0..probe.scanlines, 0..probe.samples));
    let none = Doppler { left: 1.0, right: 0.0, top: 0.5, bottom: 0.5, ..Doppler::default() };
    let made = packet(&probe, &none);
    assert_eq!((made.lines.len(), made.samples.len()), (1, 1));
    let times = packet(&probe, &Doppler { pulses: 3, prf: 1000.0, ..Doppler::default() }).times;
    assert_eq!(times, [-1e-3, 0.0, 1e-3]);
}
