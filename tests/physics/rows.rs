//! The validation table: every check once, for the tests and for the report.

use crate::physics::check::Check;

macro_rules! rows {
    ($($module:ident::$name:ident $(($long:literal))?),* $(,)?) => {
        /// All checks, in the order of the table's rows.
        pub fn all() -> Vec<Check> {
            vec![$(super::$module::$name()),*]
        }

        #[cfg(test)]
        mod proofs {
            $(#[test]
            $(#[ignore = $long])?
            fn $name() {
                let check = super::super::$module::$name();
                assert_eq!(check.name, stringify!($name));
                crate::physics::check::prove(&check);
            })*
        }
    };
}

rows! {
    interfaces::what_a_wall_lets_through_is_the_fluid_fresnel_law_at_every_angle,
    interfaces::refraction_is_snells_law_by_speeds_and_total_reflection_switches_there,
    timing::a_plate_shows_at_its_time_of_flight,
    interfaces::transmission_is_beer_lambert_times_fresnel,
    contrast::attenuation_slope_matches_beer_lambert,
    resolution::a_point_is_as_long_as_its_pulse,
    resolution::a_point_is_as_wide_as_the_beam_at_its_depth,
    resolution::a_slice_is_as_thick_as_the_lens_makes_it,
    speckle::speckle_is_fully_developed,
    speckle::log_compressed_speckle_has_one_deviation,
    speckle::sparse_speckle_follows_the_kurtosis_law,
    grain::speckle_grains_are_as_large_as_the_point_spread_function,
    grain::probe_motion_decorrelates_speckle_as_the_beam_overlaps,
    contrast::echogenicity_is_contrast,
    border::a_border_along_the_beam_is_as_wide_as_the_beam,
    contrast::an_anechoic_cyst_is_as_dark_as_the_noise,
    shadow::fluid_enhances_what_lies_behind_it,
    shadow::bone_casts_a_shadow,
    reverberation::a_slab_reverberates_at_multiples_of_its_thickness,
    reverberation::a_mirror_shows_a_target_beside_the_line_below_itself,
    refraction::a_slower_cylinder_casts_the_edge_shadow_of_its_entry_angles,
    refraction::a_faster_cylinder_reflects_totally_beyond_its_critical_impact,
    roughness::rough_surfaces_have_the_power_cosine_lobe,
    thickness::thickness_delays_echoes_by_a_half_normal ("long: ./tools/test.sh --long"),
    thickness::thick_surfaces_lose_coherence_and_keep_energy,
    brightness::brightness_behind_the_abdominal_wall_does_not_depend_on_paths ("long: ./tools/test.sh --long"),
    invariance::brightness_depends_on_neither_layers_nor_samples,
    invariance::sampling_schemes_agree,
    invariance::tissue_mirrored_by_a_rough_wall_has_the_level_of_many_paths,
    invariance::a_frame_moves_with_its_scene,
    convergence::images_converge_at_least_with_the_root_of_the_paths ("long: ./tools/test.sh --long"),
    energy::the_energy_of_paths_is_absorbed_or_leaves,
    detection::the_baseband_envelope_is_the_hilbert_envelope,
    formation::detection_shows_the_hilbert_envelope,
    levels::matched_compensation_makes_homogeneous_tissue_flat,
    levels::sliders_add_their_decibels_at_their_depths,
    formation::matched_gain_makes_decaying_speckle_flat_for_every_probe,
    levels::sectors_have_the_area_of_their_geometry,
    conversion::scan_conversion_is_exact_for_every_probe,
    fusion::the_mask_fades_over_the_box_and_leaves_both_images_alone_beyond_it,
    fusion::bands_fade_over_their_own_widths_and_need_nothing_where_images_agree,
    fusion::the_mask_of_a_ball_is_its_chord_on_every_scanline,
    fusion::a_linear_volume_is_exact_along_oblique_scanlines,
    fusion::both_borders_of_a_mask_lie_where_its_surface_echoes,
    fusion_shadows::a_slab_throws_its_shadow_into_the_volume,
    intersections::placements_are_transforms_of_the_mesh,
    squeeze::a_squeezed_slab_is_met_and_refracts_at_its_squeezed_planes,
    selectors::every_strategy_shows_the_keyframe ("long: ./tools/test.sh --long"),
    intersections::closest_hits_are_those_of_brute_force_in_double_precision,
    determinism::a_frame_repeats_bit_for_bit_and_both_tracers_show_it,
    cole::points_and_scatterers_are_those_of_a_convolution_simulator,
    apertures::points_are_as_wide_as_through_real_apertures,
    full_wave::a_slab_echoes_as_in_a_full_wave_simulation,
    full_wave::a_cylinder_shadows_as_in_a_full_wave_simulation,
    penumbra::the_edge_of_a_shadow_is_as_wide_as_the_aperture_makes_it,
    reverberation::the_echoes_of_a_plate_are_on_every_line,
    vessel::speckle_behind_a_round_vessel_is_as_bright_as_waves_make_it,
    strips::speckle_is_as_bright_however_refraction_parts_the_paths ("long: ./tools/test.sh --long"),
    chain::enhanced_speckle_has_the_deviation_of_its_correlation,
    flow::blood_decorrelates_and_turns_as_its_velocity_says,
    flow::a_vessel_has_the_profile_that_the_beam_smooths,
    flow::blood_is_as_loud_at_every_time,
}

#[test]
fn rows_are_in_order_and_names_are_unique() {
    let checks = all();
    let number = |c: &Check| -> u32 {
        let digits = c.row.strip_prefix('T').expect(c.row);
        digits.parse().expect(c.row)
    };
    assert!(checks.is_sorted_by_key(number));
    assert!(checks.iter().all(|c| (1..=43).contains(&number(c))));
    let names: std::collections::HashSet<_> = checks.iter().map(|c| c.name).collect();
    assert_eq!(names.len(), checks.len());
}
