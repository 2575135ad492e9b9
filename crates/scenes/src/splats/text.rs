//! The report of new splats as lines of text.

use super::SplatsReport;

impl SplatsReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let made = &self.made;
        let share = 100.0 * made.splats as f64 / made.cells.max(1) as f64;
        let mut text = format!(
            "splats     {} for {} cells ({share:.1} %)\nplanes     within {:.3} m\n",
            made.splats, made.cells, made.plane_error_max_m
        );
        if made.walls > 0 {
            let seen = 100.0 * made.walls_seen as f64 / made.walls as f64;
            text += &format!(
                "walls      {} of the splats on {:.0} m\u{b2}, {seen:.1} % of them seen by an image\n",
                made.walls, made.walls_area_m2
            );
        }
        if let Some(heights) = &made.mean_height {
            text += &format!(
                "heights    RMSE {:.3} m, MAE {:.3} m, median {:.3} m\n",
                heights.rmse_m, heights.mae_m, heights.median_m
            );
        }
        for image in &made.views {
            let view = &image.view;
            text += &format!(
                "image      PSNR {} dB, SSIM {}, {:.1} % covered, sees {:.1} % of the cells: {}\n",
                number(view.psnr_db),
                number(view.ssim),
                100.0 * view.coverage,
                100.0 * view.seen,
                image.image
            );
        }
        for point in &made.uniform {
            text +=
                &format!("uniform    {} splats of {} cells: RMSE {:.3} m\n", point.splats, point.side, point.rmse_m);
        }
        if let Some(count) = made.uniform_at_equal_rmse {
            text += &format!(
                "equal RMSE takes {count:.0} uniform splats, {:.1} times as many as without walls\n",
                count / (made.splats - made.walls) as f64
            );
        }
        text + &format!("written    {}\n", self.output)
    }
}

/// Two digits, or a dash where there is no number.
fn number(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |v| format!("{v:.2}"))
}
