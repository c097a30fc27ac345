use super::font::{cap_height, draw_text, text_width};
use super::{Color, Image};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};
use std::convert::Infallible;

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

/// What charts call font size, per em.
pub(super) const SIZE_PER_EM: f64 = 1.24;

/// An [`Image`] that plotters can draw on, with smooth strokes and evenly spaced letters:
/// its own bitmap has jagged joints, and puts each letter on a whole pixel.
pub(super) struct Canvas<'a>(pub &'a mut Image);

impl Canvas<'_> {
    /// Covers what lies within half of `width` [px] of the segment from `a` to `b`.
    fn segment(&mut self, a: BackendCoord, b: BackendCoord, width: f64, color: BackendColor) {
        let [dx, dy] = [f64::from(b.0 - a.0), f64::from(b.1 - a.1)];
        let length_squared = (dx * dx + dy * dy).max(1.0);
        let reach = (width / 2.0).ceil() as i32 + 1;
        let range = |a: i32, b: i32, limit: usize| {
            let limit = i32::try_from(limit).unwrap_or(i32::MAX);
            (a.min(b) - reach).max(0)..(a.max(b) + reach + 1).min(limit)
        };
        for y in range(a.1, b.1, self.0.height) {
            for x in range(a.0, b.0, self.0.width) {
                let [px, py] = [f64::from(x - a.0), f64::from(y - a.1)];
                let t = ((px * dx + py * dy) / length_squared).clamp(0.0, 1.0);
                let distance = (px - t * dx).hypot(py - t * dy);
                let coverage = (0.5 + width / 2.0 - distance).clamp(0.0, 1.0);
                self.0.blend(x, y, rgb(color), coverage * color.alpha);
            }
        }
    }
}

fn rgb(color: BackendColor) -> Color {
    color.rgb.into()
}

impl DrawingBackend for Canvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.0.width as u32, self.0.height as u32)
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, color: BackendColor) -> Drawn {
        self.0.blend(x, y, rgb(color), color.alpha);
        Ok(())
    }

    fn draw_line<S: BackendStyle>(&mut self, a: BackendCoord, b: BackendCoord, style: &S) -> Drawn {
        self.segment(a, b, f64::from(style.stroke_width()), style.color());
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        let mut before = None;
        for point in path {
            if let Some(before) = before {
                self.draw_line(before, point, style)?;
            }
            before = Some(point);
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        center: BackendCoord,
        radius: u32,
        style: &S,
        _fill: bool,
    ) -> Drawn {
        // Charts draw filled circles only.
        self.segment(center, center, 2.0 * f64::from(radius), style.color());
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        pos: BackendCoord,
    ) -> Drawn {
        let size = (style.size() / SIZE_PER_EM) as f32;
        let width = text_width(text, size);
        let dx = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => -width / 2.0,
            HPos::Right => -width,
        };
        let dy = match style.anchor().v_pos {
            VPos::Top => cap_height(size),
            VPos::Center => cap_height(size) / 2.0,
            VPos::Bottom => 0.0,
        };
        let (dx, dy) = (dx.round() as i32, dy.round() as i32);
        let (color, transform) = (style.color(), style.transform());
        draw_text(text, size, |x, y, coverage| {
            let (x, y) = transform.transform(x + dx, y + dy);
            let alpha = f64::from(coverage) * color.alpha;
            self.0.blend(pos.0 + x, pos.1 + y, rgb(color), alpha);
        });
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = (style.size() / SIZE_PER_EM) as f32;
        Ok((text_width(text, size).ceil() as u32, size.ceil() as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLACK: BackendColor = BackendColor {
        alpha: 1.0,
        rgb: (0, 0, 0),
    };

    /// Sum of darkness, in pixels.
    fn ink(image: &Image) -> f64 {
        let dark = image.pixels.iter().map(|p| 1.0 - f64::from(p[0]) / 255.0);
        dark.sum()
    }

    #[test]
    fn hairline_along_an_axis_is_one_crisp_row() {
        let mut image = Image::new(40, 9, [255; 3]);
        Canvas(&mut image)
            .draw_line((5, 4), (34, 4), &BLACK)
            .unwrap();
        let row = |y: usize| &image.pixels[y * 40 + 5..][..30];
        assert!(row(4).iter().all(|&p| p == [0; 3]));
        assert!(row(3).iter().chain(row(5)).all(|&p| p == [255; 3]));
    }

    #[test]
    fn slanted_stroke_covers_its_length_times_its_width() {
        let mut image = Image::new(80, 80, [255; 3]);
        Canvas(&mut image).segment((10, 10), (70, 55), 3.0, BLACK);
        // 75 by 3 pixels and two half discs.
        let expected = 225.0 + std::f64::consts::PI * 2.25;
        assert!((ink(&image) - expected).abs() < 3.0, "{}", ink(&image));
    }

    #[test]
    fn disc_covers_its_area() {
        let mut image = Image::new(40, 40, [255; 3]);
        Canvas(&mut image)
            .draw_circle((20, 20), 9, &BLACK, true)
            .unwrap();
        let expected = std::f64::consts::PI * 81.0;
        assert!((ink(&image) - expected).abs() < 2.0, "{}", ink(&image));
    }

    #[test]
    fn nothing_is_drawn_outside() {
        let mut image = Image::new(10, 10, [255; 3]);
        let mut canvas = Canvas(&mut image);
        canvas.segment((-50, -50), (-20, -60), 3.0, BLACK);
        canvas.draw_pixel((10, 0), BLACK).unwrap();
        assert_eq!(ink(&image), 0.0);
    }
}
