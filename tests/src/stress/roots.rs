//! Powers without a derivative at zero.

use super::{Case, Extent, Family, by_hardness};

/// The exponents.
const POWERS: [(&str, f64); 5] = [
    ("1/3", 1.0 / 3.0),
    ("1/2", 0.5),
    ("2/3", 2.0 / 3.0),
    ("1.5", 1.5),
    ("2.5", 2.5),
];

/// An exponent with two decimals.
fn rounded(p: f64) -> String {
    format!("{:?}", (100.0 * p).round() / 100.0)
}

pub fn families(extent: Extent) -> Vec<Family> {
    vec![
        at_zero(extent),
        behind_zero(extent),
        spirals(extent),
        refilled(extent),
    ]
}

/// Numbers between 0 and 1, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        // Knuth's MMIX.
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = self.0.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// With two decimals.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        (100.0 * (low + (high - low) * self.next())).round() / 100.0
    }

    fn power(&mut self) -> (&'static str, f64) {
        POWERS[(5.0 * self.next()) as usize]
    }
}

/// c |u|^p with random c and p that is crossed, reached in finite time, left, left from rest, or struck.
fn at_zero(extent: Extent) -> Family {
    let kinds: [fn(&mut Numbers) -> Case; 6] =
        [crossed, reached, left, left_from_rest, struck, never_left];
    let mut numbers = Numbers(25);
    let n = extent.of(6, 240);
    let cases = (0..n).flat_map(|k| {
        let case = kinds[k % kinds.len()](&mut numbers).within(20);
        [case.clone(), case.accurate_if(false).by("fesd")]
    });
    Family {
        name: "roots at zero",
        about: "Laws c |u|^p or c max(u, 0)^p, p in {1/3, 1/2, 2/3, 1.5, 2.5}: integrated across a transversal zero, from \
                one, and from rest; emptied in finite time; impacts without loss. Closed forms, the duration of an impact \
                by Simpson's rule.",
        hardness: "p",
        cases: by_hardness(cases),
    }
}

/// y' = c |x|^p, up to just behind the zero of x and farther on.
fn behind_zero(extent: Extent) -> Family {
    let mut numbers = Numbers(27);
    let n = extent.of(6, 200);
    let cases = (0..n).map(|k| {
        let p = [0.25, 0.5, 0.75, 1.5][k % 4];
        let [a, v, c] = [(0.2, 1.0), (0.5, 2.0), (0.5, 3.0)].map(|(l, h)| numbers.between(l, h));
        let b = numbers.between(0.01, 1.0) * [1.0, 1e-2, 1e-4][k % 3];
        let model =
            format!("state x = -{a:?}; state y = 0; x' = {v:?}; y' = {c:?}*abs(x)^({p:?});");
        let exact = c / v * (a.powf(p + 1.0) + b.powf(p + 1.0)) / (p + 1.0);
        let case = Case::new(rounded(p), model, (a + b) / v).ends("y", &[exact], exact);
        case.by("fesd").within(20)
    });
    Family {
        name: "just behind a root",
        about: "y' = c |x|^p across a transversal zero of x, p in {0.25, 0.5, 0.75, 1.5}, to 1e-6 to 1 behind it: what elements \
                that have no order there are off by, closed forms.",
        hardness: "p",
        cases: by_hardness(cases),
    }
}

/// Super-twisting that comes to its origin.
fn spirals(extent: Extent) -> Family {
    let mut numbers = Numbers(26);
    let n = extent.of(2, 60);
    let cases = (0..n).flat_map(|_| {
        let case = twisted(&mut numbers).within(20).accurate_if(false);
        case.both()
    });
    Family {
        name: "spirals of super-twisting",
        about: "x' = -k sqrt(abs(x)) sign(x) + w, w' = -l sign(x), which comes to its origin by infinitely many crossings \
                and stays there, and a state that is moved by the sign. Linear between crossings in the root of x.",
        hardness: "ratio of speeds",
        cases: by_hardness(cases),
    }
}

/// A tank that has run dry and is filled again by c (t - 2): h = a (t - 2)² with 2 a + k √a = c.
///
/// Of 400 random ones each with c/k² in [0.0003, 0.001), [0.001, 0.003), [0.003, 0.005) and [0.005, 0.01), 21, 10, 4
/// and 0 end just behind 2 with a report that a switch was missed or that events accumulate.
fn refilled(extent: Extent) -> Family {
    let mut numbers = Numbers(28);
    let n = extent.of(6, 200);
    let cases = (0..n).map(|k| {
        let outflow = numbers.between(0.2, 3.0);
        let inflow = numbers.between(0.5, 3.0) * [1.0, 0.1, 0.01][k % 3];
        let start = numbers.between(0.01, 0.03);
        let root = 2.0 * inflow / (outflow + outflow.hypot((8.0 * inflow).sqrt()));
        let end = (root * 2.0).powi(2);
        let model = format!(
            "state h = {start:?}; h' = {inflow:?}*max(time - 2, 0) - {outflow:?}*sqrt(max(h, 0));"
        );
        let case = Case::new(format!("{:.2e}", inflow / outflow.powi(2)), model, 4.0);
        // Its equilibrium grows k²/(2c) times as slowly as it is reached: above 100 times some runs end with a report.
        let case = case.accurate_if(inflow >= 0.005 * outflow.powi(2));
        case.ends("h", &[end], start.max(end)).within(20)
    });
    Family {
        name: "tanks that are filled again",
        about: "h' = c max(t - 2, 0) - k sqrt(max(h, 0)) from little: it runs dry before 2, and is a (t - 2)² from \
                then on. Below c/k² = 0.005 some 3 % end with a report.",
        hardness: "c/k²",
        cases: by_hardness(cases),
    }
}

/// x' = v from -a: y' = c |x|^p, or of its positive part.
fn crossed(numbers: &mut Numbers) -> Case {
    let (word, p) = numbers.power();
    let [a, v, c] = [(0.2, 1.0), (0.5, 2.0), (0.5, 3.0)].map(|(l, h)| numbers.between(l, h));
    let b = numbers.between(0.2, 1.0);
    let horizon = (a + b) / v;
    let is_even = numbers.next() < 0.5;
    let law = if is_even { "abs(x)" } else { "max(x, 0)" };
    let model = format!("state x = -{a:?}; state y = 0; x' = {v:?}; y' = {c:?}*{law}^({word});");
    let of = |u: f64| c / v * u.powf(p + 1.0) / (p + 1.0);
    let exact = of(b) + if is_even { of(a) } else { 0.0 };
    let case = Case::new(rounded(p), model, horizon).ends("y", &[exact], exact);
    case.switches_at(&[a / v])
}

/// h' = -c h^p with p < 1, and its integral.
fn reached(numbers: &mut Numbers) -> Case {
    let (word, p) = POWERS[(3.0 * numbers.next()) as usize];
    let [start, c] = [(0.3, 2.0), (0.5, 3.0)].map(|(l, h)| numbers.between(l, h));
    let sign = if numbers.next() < 0.5 { 1.0 } else { -1.0 };
    let (law, sign) = match numbers.next() < 0.5 {
        true => (format!("max(h, 0)^({word})"), 1.0),
        false => (format!("sign(h)*abs(h)^({word})"), sign),
    };
    let until = start.powf(1.0 - p) / (c * (1.0 - p));
    let model = format!(
        "state h = {:?}; state y = 0; h' = -{c:?}*{law}; y' = h;",
        sign * start
    );
    let area = sign * start.powf(2.0 - p) / (c * (2.0 - p));
    let case = Case::new(rounded(p), model, 1.5 * until).ends("h", &[0.0], start);
    case.ends("y", &[area], area.abs()).switches(1)
}

/// x' = v from zero.
fn left(numbers: &mut Numbers) -> Case {
    let (word, p) = numbers.power();
    let [v, c, horizon] = [(0.5, 2.0), (0.5, 3.0), (0.5, 2.0)].map(|(l, h)| numbers.between(l, h));
    let law = if numbers.next() < 0.5 {
        "abs(x)"
    } else {
        "max(x, 0)"
    };
    let model = format!("state x = 0; state y = 0; x' = {v:?}; y' = {c:?}*{law}^({word});");
    let exact = c / v * (v * horizon).powf(p + 1.0) / (p + 1.0);
    Case::new(rounded(p), model, horizon).ends("y", &[exact], exact)
}

/// x'' = g from rest.
fn left_from_rest(numbers: &mut Numbers) -> Case {
    let (word, p) = numbers.power();
    let [g, c, horizon] = [(0.5, 3.0), (0.5, 3.0), (0.5, 2.0)].map(|(l, h)| numbers.between(l, h));
    let model = format!(
        "state x = 0; state v = 0; state y = 0; x' = v; v' = {g:?}; y' = {c:?}*max(x, 0)^({word});"
    );
    let n = 2.0 * p + 1.0;
    let exact = c * (0.5 * g).powf(p) * horizon.powf(n) / n;
    Case::new(rounded(p), model, horizon).ends("y", &[exact], exact)
}

/// q'' = k max(-q, 0)^p: the speed at the exit is that at the entry, and the duration of an impact that goes as deep
/// as d is 2 d/v ∫ ds/√(1 - s^(p + 1)) over [0, 1].
fn struck(numbers: &mut Numbers) -> Case {
    let (word, p) = numbers.power();
    let [v, stiff, gap] = [(0.5, 3.0), (1.0, 50.0), (0.2, 1.0)].map(|(l, h)| numbers.between(l, h));
    let n = p + 1.0;
    let depth = (0.5 * v * v * n / stiff).powf(1.0 / n);
    // With s = 1 - r².
    let density = |r: f64| match r {
        0.0 => 2.0 / n.sqrt(),
        _ => 2.0 * r / (-(n * (-r * r).ln_1p()).exp_m1()).sqrt(),
    };
    let m = 100_000;
    let inner = (1..m).map(|j| {
        let weight = if j % 2 == 1 { 4.0 } else { 2.0 };
        weight * density(j as f64 / m as f64)
    });
    let integral = (density(0.0) + inner.sum::<f64>() + 2.0) / (3.0 * m as f64);
    let lasts = 2.0 * depth / v * integral;
    let enters = gap / v;
    let model =
        format!("state q = {gap:?}; state v = -{v:?}; q' = v; v' = {stiff:?}*max(-q, 0)^({word});");
    let after = 0.5;
    Case::new(rounded(p), model, enters + lasts + after)
        .ends("v", &[v], v)
        .ends("q", &[v * after], f64::max(gap, v * after))
        .switches_at(&[enters, enters + lasts])
}

/// What is empty stays empty, or at the level of what it is joined to.
fn never_left(numbers: &mut Numbers) -> Case {
    let (word, p) = POWERS[(3.0 * numbers.next()) as usize];
    let [c, level, rise] = [(0.5, 3.0), (0.5, 3.0), (0.1, 1.0)].map(|(l, h)| numbers.between(l, h));
    let model = format!(
        "state a = {level:?}; state b = {level:?}; state h = 0; let p = a - b;
         a' = {rise:?} - {c:?}*sign(p)*abs(p)^({word}); b' = {rise:?} + {c:?}*sign(p)*abs(p)^({word});
         h' = -{c:?}*max(h, 0)^({word});"
    );
    let ends = level + 2.0 * rise;
    let case = Case::new(rounded(p), model, 2.0).ends("h", &[0.0], 1.0);
    case.ends("a", &[ends], ends).ends("b", &[ends], ends)
}

/// x' = -k √|x| sign x + w, w' = -l sign x, y' = t sign x from x = a, w = 0. With ζ = √|x| and dt = 2ζ dτ these are the
/// linear ζ' = w - k ζ, w' = -2l ζ between crossings, with ω² = 2l - k²/4: each |w| is e^(-kπ/(2ω)) times the one before.
fn twisted(numbers: &mut Numbers) -> Case {
    let [start, l, share] =
        [(0.3, 2.0), (0.5, 3.0), (0.3, 0.9)].map(|(l, h)| numbers.between(l, h));
    let gain = (100.0 * share * (8.0 * l).sqrt()).round() / 100.0;
    let omega = (2.0 * l - 0.25 * gain * gain).sqrt();
    let first = (2.0 * omega / gain).atan() / omega;
    let mut speed = (2.0 * l * start).sqrt() * (-0.5 * gain * first).exp();
    let ratio = (-0.5 * gain * std::f64::consts::PI / omega).exp();
    let ends = 2.0 * speed / (l * (1.0 - ratio));
    let (mut from, mut to, mut sign, mut moment) = (0.0, speed / l, 1.0, 0.0);
    while to > from {
        moment += 0.5 * sign * (to * to - from * from);
        (from, to, sign) = (to, to + speed * (1.0 + ratio) / l, -sign);
        speed *= ratio;
    }
    let model = format!(
        "state x = {start:?}; state w = 0; state y = 0;
         x' = -{gain:?}*sqrt(abs(x))*sign(x) + w; w' = -{l:?}*sign(x); y' = time*sign(x);"
    );
    let case = Case::new(format!("{ratio:.1}"), model, 1.5 * ends);
    let case = case.ends("x", &[0.0], start).ends("w", &[0.0], 1.0);
    case.ends("y", &[moment], ends * ends)
}
