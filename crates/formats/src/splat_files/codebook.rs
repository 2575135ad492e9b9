//! Numbers as bytes: 256 values that stand for many (Lloyd 1982), and a palette of vectors.

/// Number of values of a codebook.
pub(super) const CODES: usize = 256;
/// Parts of the range in which the density is counted.
const BINS: usize = 4096;
/// Steps of Lloyd's algorithm; the error hardly falls after them.
const STEPS: usize = 40;

/// 256 values in ascending order.
pub(super) struct Codebook(pub(super) Vec<f32>);

impl Codebook {
    /// Returns the values that are close to all of `numbers`, which must be finite.
    pub(super) fn of(mut numbers: Vec<f32>) -> Self {
        numbers.sort_by(f32::total_cmp);
        let mut distinct = numbers.clone();
        distinct.dedup();
        let Some((&low, &high)) = distinct.first().zip(distinct.last()) else { return Self(vec![0.0; CODES]) };
        if distinct.len() <= CODES {
            distinct.resize(CODES, high);
            return Self(distinct);
        }
        // Sums of all numbers before a place.
        let mut sums = vec![0.0f64];
        sums.extend(numbers.iter().scan(0.0f64, |sum, n| {
            *sum += f64::from(*n);
            Some(*sum)
        }));
        let mut codes = spread(&numbers, low, high);
        for _ in 0..STEPS {
            let mut from = 0;
            for k in 0..CODES {
                let to = match codes.get(k + 1) {
                    Some(next) => numbers.partition_point(|n| *n <= 0.5 * (codes[k] + next)).max(from),
                    None => numbers.len(),
                };
                if to > from {
                    codes[k] = ((sums[to] - sums[from]) / (to - from) as f64) as f32;
                }
                from = to;
            }
            codes.sort_by(f32::total_cmp);
        }
        Self(codes)
    }

    /// Returns the place of the nearest value.
    pub(super) fn nearest(&self, number: f32) -> u8 {
        let after = self.0.partition_point(|code| *code < number).min(CODES - 1);
        let before = after.saturating_sub(1);
        let is_before = (self.0[before] - number).abs() <= (self.0[after] - number).abs();
        (if is_before { before } else { after }) as u8
    }
}

/// Returns values that lie as close as the cube root of the density of sorted numbers asks, which
/// keeps the squared error least where there are many of them (Panter and Dite 1951).
fn spread(numbers: &[f32], low: f32, high: f32) -> Vec<f32> {
    let width = f64::from(high - low) / BINS as f64;
    let mut weights = vec![0.0f64; BINS];
    for number in numbers {
        weights[((f64::from(number - low) / width) as usize).min(BINS - 1)] += 1.0;
    }
    weights.iter_mut().for_each(|weight| *weight = weight.cbrt());
    let step = weights.iter().sum::<f64>() / CODES as f64;
    let (mut codes, mut sum) = (Vec::with_capacity(CODES), 0.0);
    for (bin, weight) in weights.into_iter().enumerate() {
        while codes.len() < CODES && (codes.len() as f64 + 0.5) * step <= sum + weight {
            let share = ((codes.len() as f64 + 0.5) * step - sum) / weight;
            codes.push((f64::from(low) + width * (bin as f64 + share)) as f32);
        }
        sum += weight;
    }
    codes.resize(CODES, high);
    codes
}

/// Vectors that stand for many.
pub(super) struct Palette {
    /// The vectors, one after the other.
    pub(super) vectors: Vec<f32>,
    /// For each vector of the input its place in the palette.
    pub(super) labels: Vec<u16>,
}

impl Palette {
    /// Most vectors of a palette.
    pub(super) const VECTORS_MAX: usize = 1 << 16;

    /// Returns at most `most` means that stand for vectors of `size` numbers: parts are halved
    /// along the direction in which they spread most until there are enough of them.
    pub(super) fn of(vectors: &[f32], size: usize, most: usize) -> Self {
        let count = vectors.len() / size;
        let mut order: Vec<u32> = (0..count as u32).collect();
        let (mut palette, mut labels) = (Vec::new(), vec![0u16; count]);
        let mut parts = vec![(&mut order[..], most.min(Self::VECTORS_MAX))];
        while let Some((part, room)) = parts.pop() {
            let at = |number: u32, i: usize| vectors[number as usize * size + i];
            if part.len() <= 1 || room <= 1 {
                let mean = |i: usize| {
                    let sum: f64 = part.iter().map(|&number| f64::from(at(number, i))).sum();
                    (sum / part.len().max(1) as f64) as f32
                };
                let label = (palette.len() / size) as u16;
                palette.extend((0..size).map(mean));
                part.iter().for_each(|&number| labels[number as usize] = label);
                continue;
            }
            let spread = |i: usize| {
                let (sum, squares) = part.iter().fold((0.0, 0.0), |(sum, squares), &number| {
                    let value = f64::from(at(number, i));
                    (sum + value, squares + value * value)
                });
                squares - sum * sum / part.len() as f64
            };
            let spreads: Vec<f64> = (0..size).map(spread).collect();
            let widest = (1..size).fold(0, |best, i| if spreads[i] > spreads[best] { i } else { best });
            let middle = part.len() / 2;
            part.select_nth_unstable_by(middle, |&a, &b| at(a, widest).total_cmp(&at(b, widest)).then(a.cmp(&b)));
            let (low, high) = part.split_at_mut(middle);
            let half = room / 2;
            parts.push((high, room - half));
            parts.push((low, half));
        }
        Self { vectors: palette, labels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_kept_and_many_are_close() {
        let few = Codebook::of(vec![3.0, -1.0, 3.0, 7.5]);
        assert!([3.0, -1.0, 7.5].iter().all(|n| few.0[usize::from(few.nearest(*n))] == *n));
        // Most of them small, some large: a cube.
        let many: Vec<f32> = (0..60_000).map(|i| 4.0 * (i as f32 / 30_000.0 - 1.0).powi(3)).collect();
        let book = Codebook::of(many.clone());
        let squares: f64 = many.iter().map(|n| f64::from(book.0[usize::from(book.nearest(*n))] - n).powi(2)).sum();
        let worst = many.iter().map(|n| (book.0[usize::from(book.nearest(*n))] - n).abs()).fold(0.0, f32::max);
        // The least possible is (∫ f^⅓)^1.5 / (256 √12) = 0.00759 for this density f (Panter and
        // Dite); even steps over the range would have 8 / 256 / √12 = 0.0090.
        let rmse = (squares / many.len() as f64).sqrt();
        assert!(rmse < 0.00767 && worst < 0.05, "{rmse} {worst}");
    }

    #[test]
    fn a_palette_holds_every_vector_where_it_can() {
        let vectors: Vec<f32> = (0..300).map(|i| ((i * 37) % 101) as f32).collect();
        let whole = Palette::of(&vectors, 3, Palette::VECTORS_MAX);
        let seen = |palette: &Palette, i: usize| palette.vectors[usize::from(palette.labels[i]) * 3..][..3].to_vec();
        assert!((0..100).all(|i| seen(&whole, i) == vectors[3 * i..3 * i + 3]));
        let small = Palette::of(&vectors, 3, 10);
        assert_eq!(small.vectors.len(), 30);
        let error: f32 = (0..100)
            .flat_map(|i| (0..3).map(move |k| (i, k)))
            .map(|(i, k)| (seen(&small, i)[k] - vectors[3 * i + k]).powi(2))
            .sum();
        let mean = vectors.iter().sum::<f32>() / 300.0;
        let spread: f32 = vectors.iter().map(|v| (v - mean).powi(2)).sum();
        assert!(error < 0.5 * spread, "{error} of {spread}");
    }
}
