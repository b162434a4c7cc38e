//! Gestational age and weight from biometry. Lengths are mm here and cm in the sources' formulas.
//!
//! Every set of coefficients was compared with at least two transcriptions made by others, and is tested against
//! figures that were published apart from it; `docs/exam.md` names both.

/// Age by the crown-rump length, days: Robinson and Fleming, Br J Obstet Gynaecol 1975;82:702-710, with their
/// correction of 3.7 % for the calipers of the time (6 to 14 weeks).
pub fn age_by_crl(crl: f64) -> f64 {
    8.052 * (1.037 * crl).sqrt() + 23.73
}

/// Age by the crown-rump length, weeks: Hadlock et al., Radiology 1992;182:501-505 (5 to 18 weeks).
pub fn age_by_crl_hadlock(crl: f64) -> f64 {
    let x = crl / 10.0;
    polynomial(&[1.684_969, 0.315_646, -0.049_306, 0.004_057, -0.000_120_456], x).exp()
}

/// Age by the biparietal diameter, weeks: Hadlock et al., Radiology 1984;152:497-501, as are those below (14 to 42
/// weeks).
pub fn age_by_bpd(bpd: f64) -> f64 {
    polynomial(&[9.54, 1.482, 0.1676], bpd / 10.0)
}

/// Age by the head circumference, weeks.
pub fn age_by_hc(hc: f64) -> f64 {
    polynomial(&[8.96, 0.540, 0.0, 0.0003], hc / 10.0)
}

/// Age by the abdominal circumference, weeks.
pub fn age_by_ac(ac: f64) -> f64 {
    polynomial(&[8.14, 0.753, 0.0036], ac / 10.0)
}

/// Age by the length of the femur, weeks.
pub fn age_by_fl(fl: f64) -> f64 {
    polynomial(&[10.35, 2.460, 0.170], fl / 10.0)
}

/// Age by all four, weeks.
pub fn age_by_all([bpd, hc, ac, fl]: [f64; 4]) -> f64 {
    let [bpd, hc, ac, fl] = [bpd, hc, ac, fl].map(|mm| mm / 10.0);
    10.85 + 0.060 * hc * fl + 0.6700 * bpd + 0.1680 * ac
}

/// Weight, g: Hadlock et al., Am J Obstet Gynecol 1985;151:333-337. `head` is the biparietal diameter and the head
/// circumference, as far as they are known.
pub fn weight(head: [Option<f64>; 2], ac: f64, fl: f64) -> f64 {
    let [bpd, hc] = head.map(|mm| mm.map(|mm| mm / 10.0));
    let (ac, fl) = (ac / 10.0, fl / 10.0);
    let exponent = match (bpd, hc) {
        (None, None) => 1.304 + 0.052_81 * ac + 0.1938 * fl - 0.004 * ac * fl,
        (Some(bpd), None) => 1.335 - 0.0034 * ac * fl + 0.0316 * bpd + 0.0457 * ac + 0.1623 * fl,
        (None, Some(hc)) => 1.326 - 0.003_26 * ac * fl + 0.0107 * hc + 0.0438 * ac + 0.158 * fl,
        (Some(bpd), Some(hc)) => {
            1.3596 - 0.003_86 * ac * fl
                + 0.0064 * hc
                + 0.000_61 * bpd * ac
                + 0.0424 * ac
                + 0.174 * fl
        }
    };
    10_f64.powf(exponent)
}

/// An age as examiners say it: "20w 3d".
pub fn spoken(weeks: f64) -> String {
    let days = (7.0 * weeks).round();
    format!("{}w {}d", (days / 7.0).floor(), days % 7.0)
}

fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64, within: f64) {
        assert!((found - expected).abs() <= within, "{found} {expected}");
    }

    #[test]
    fn ages_are_those_of_the_formulas_worked_out_by_hand() {
        close(age_by_bpd(50.0), 9.54 + 7.41 + 4.19, 1e-9);
        close(age_by_hc(200.0), 8.96 + 10.8 + 2.4, 1e-9);
        close(age_by_ac(200.0), 8.14 + 15.06 + 1.44, 1e-9);
        close(age_by_fl(50.0), 10.35 + 12.3 + 4.25, 1e-9);
        close(age_by_all([90.0, 320.0, 330.0, 70.0]), 10.85 + 13.44 + 6.03 + 5.544, 1e-9);
        // 8.052 sqrt(44.591) + 23.73: 11 weeks, as the shipped fetus was made.
        close(age_by_crl(43.0), 77.498, 1e-3);
    }

    /// Mean BPD, HC, AC and FL, mm, at an age in weeks: fitted by Hadlock et al. to the same fetuses the other way
    /// round (Radiology 1984;152:497-501).
    fn means(weeks: f64) -> [f64; 4] {
        let of = |c: [f64; 4]| 10.0 * polynomial(&c, weeks);
        [
            of([-3.08, 0.41, 0.0, -0.000_061]),
            of([-11.48, 1.56, 0.0, -0.000_254_8]),
            of([-13.3, 1.61, -0.00998, 0.0]),
            of([-3.91, 0.427, -0.0034, 0.0]),
        ]
    }

    #[test]
    fn mean_fetuses_have_their_age() {
        for weeks in [16.0, 20.0, 24.0, 28.0, 32.0, 36.0] {
            let [bpd, hc, ac, fl] = means(weeks);
            for found in [age_by_bpd(bpd), age_by_hc(hc), age_by_ac(ac), age_by_fl(fl)] {
                close(found, weeks, 1.5);
            }
            close(age_by_all([bpd, hc, ac, fl]), weeks, 0.8);
        }
        // Medians at 20 weeks of other fetuses: Snijders and Nicolaides, Ultrasound Obstet Gynecol 1994;4:34-48.
        for weeks in [age_by_bpd(47.0), age_by_hc(175.0), age_by_ac(150.0), age_by_fl(33.0)] {
            close(weeks, 20.2, 0.8);
        }
    }

    #[test]
    fn mean_fetuses_have_the_weight_of_the_growth_curve() {
        // Hadlock et al., Radiology 1991;181:129-133.
        let median = |weeks: f64| polynomial(&[0.578, 0.332, -0.00354], weeks).exp();
        for weeks in [20.0, 24.0, 28.0, 32.0, 36.0] {
            let [bpd, hc, ac, fl] = means(weeks);
            for head in [[None, None], [Some(bpd), None], [None, Some(hc)], [Some(bpd), Some(hc)]] {
                close(weight(head, ac, fl) / median(weeks), 1.0, 0.06);
            }
        }
    }

    #[test]
    fn crown_rump_lengths_have_the_ages_of_published_tables() {
        // Means of Robinson and Fleming, mm, as their calipers had them: 3.7 % too long.
        for (days, crl) in [(49, 9.3), (63, 25.8), (70, 33.0), (77, 46.7), (84, 58.3), (91, 72.5)] {
            close(age_by_crl(crl / 1.037), f64::from(days), 2.0);
        }
        // Medians of Verburg et al., Ultrasound Obstet Gynecol 2008;31:388-396.
        for (crl, weeks, days) in [(40.0, 10, 6), (50.0, 11, 5), (60.0, 12, 3), (70.0, 13, 0)] {
            close(7.0 * age_by_crl_hadlock(crl), f64::from(7 * weeks + days), 2.0);
        }
        // The range that Hadlock et al. give: 2 mm to 12 cm, 5 to 18 weeks.
        close(age_by_crl_hadlock(2.0), 5.5, 0.5);
        close(age_by_crl_hadlock(120.0), 18.0, 0.2);
    }

    #[test]
    fn weights_of_all_forms_agree_about_one_fetus() {
        // 90, 325, 340 and 72 mm: about 37 weeks and 3 kg.
        for head in
            [[None, None], [Some(90.0), None], [None, Some(325.0)], [Some(90.0), Some(325.0)]]
        {
            close(weight(head, 340.0, 72.0), 3150.0, 150.0);
        }
        // By hand: 1.3596 - 0.00386 * 30 * 6 + 0.0064 * 29 + 0.00061 * 8 * 30 + 0.0424 * 30 + 0.174 * 6.
        let found = weight([Some(80.0), Some(290.0)], 300.0, 60.0);
        close(found.log10(), 1.3596 - 0.6948 + 0.1856 + 0.1464 + 1.272 + 1.044, 1e-9);
    }

    #[test]
    fn ages_are_spoken_in_weeks_and_days() {
        assert_eq!(spoken(11.0), "11w 0d");
        assert_eq!(spoken(20.999), "21w 0d");
        assert_eq!(spoken(20.43), "20w 3d");
    }
}
