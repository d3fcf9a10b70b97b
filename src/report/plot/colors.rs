//! Colours that readers with any colour vision can tell apart.

/// Series colours on a light ground: those of Okabe and Ito (2008), in the
/// order of their contrast, with grey for their yellow, which vanishes on white.
pub const LIGHT_PALETTE: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#a6568a", "#e69f00", "#3f9bd6", "#222222", "#7a7a7a"];

/// The same hues, lightened for a dark ground.
pub const DARK_PALETTE: [&str; 8] =
    ["#4aa8e0", "#f0803c", "#35c79c", "#dd93bf", "#f2b83b", "#8fd0f5", "#e8e8e8", "#a0a0a0"];

/// Roles of colour besides the series: name, light, dark.
pub(super) const ROLES: [(&str, &str, &str); 7] = [
    ("bg", "#ffffff", "#14181d"),
    ("fg", "#1f2328", "#e6e6e6"),
    ("muted", "#5b636b", "#9aa4ae"),
    ("frame", "#3b4249", "#8a949e"),
    ("grid", "#dfe3e6", "#2b3239"),
    ("minor", "#eff1f2", "#20262c"),
    ("forbidden", "#c0392b", "#ff7b6b"),
];

/// The light colour of a role.
pub(super) fn role(name: &str) -> &'static str {
    ROLES.iter().find(|r| r.0 == name).map_or("#000000", |r| r.1)
}

/// The CSS variables that [`STYLESHEET`] uses, with light or dark values.
pub(in crate::report) fn variables(dark: bool) -> String {
    let roles = ROLES
        .iter()
        .map(|&(name, light, night)| format!("--cx-{name}:{}", if dark { night } else { light }));
    let palette = if dark { DARK_PALETTE } else { LIGHT_PALETTE };
    let series = palette.iter().enumerate().map(|(i, color)| format!("--cx-{i}:{color}"));
    roles.chain(series).collect::<Vec<_>>().join(";")
}

/// Style rules that let the figures follow a dark or a light page.
///
/// Every element carries its light colour as an attribute, which these rules
/// override. Viewers without CSS variables keep the attributes.
pub const STYLESHEET: &str = "\
.cx-plot{--cx-bg:#ffffff;--cx-fg:#1f2328;--cx-muted:#5b636b;--cx-frame:#3b4249;--cx-grid:#dfe3e6;\
--cx-minor:#eff1f2;--cx-forbidden:#c0392b;--cx-0:#0072b2;--cx-1:#d55e00;--cx-2:#009e73;\
--cx-3:#a6568a;--cx-4:#e69f00;--cx-5:#3f9bd6;--cx-6:#222222;--cx-7:#7a7a7a}
@media (prefers-color-scheme:dark){.cx-plot{--cx-bg:#14181d;--cx-fg:#e6e6e6;--cx-muted:#9aa4ae;\
--cx-frame:#8a949e;--cx-grid:#2b3239;--cx-minor:#20262c;--cx-forbidden:#ff7b6b;--cx-0:#4aa8e0;\
--cx-1:#f0803c;--cx-2:#35c79c;--cx-3:#dd93bf;--cx-4:#f2b83b;--cx-5:#8fd0f5;--cx-6:#e8e8e8;\
--cx-7:#a0a0a0}}
@media print{.cx-plot{--cx-bg:#ffffff;--cx-fg:#1f2328;--cx-muted:#5b636b;--cx-frame:#3b4249;\
--cx-grid:#dfe3e6;--cx-minor:#eff1f2;--cx-forbidden:#c0392b;--cx-0:#0072b2;--cx-1:#d55e00;\
--cx-2:#009e73;--cx-3:#a6568a;--cx-4:#e69f00;--cx-5:#3f9bd6;--cx-6:#222222;--cx-7:#7a7a7a}}
.cx-f-bg{fill:var(--cx-bg)}.cx-f-fg{fill:var(--cx-fg)}.cx-f-muted{fill:var(--cx-muted)}\
.cx-f-frame{fill:var(--cx-frame)}.cx-f-forbidden{fill:var(--cx-forbidden)}
.cx-s-bg{stroke:var(--cx-bg)}.cx-s-fg{stroke:var(--cx-fg)}.cx-s-muted{stroke:var(--cx-muted)}\
.cx-s-frame{stroke:var(--cx-frame)}.cx-s-grid{stroke:var(--cx-grid)}\
.cx-s-minor{stroke:var(--cx-minor)}.cx-s-forbidden{stroke:var(--cx-forbidden)}
.cx-f-0{fill:var(--cx-0)}.cx-f-1{fill:var(--cx-1)}.cx-f-2{fill:var(--cx-2)}\
.cx-f-3{fill:var(--cx-3)}.cx-f-4{fill:var(--cx-4)}.cx-f-5{fill:var(--cx-5)}\
.cx-f-6{fill:var(--cx-6)}.cx-f-7{fill:var(--cx-7)}
.cx-s-0{stroke:var(--cx-0)}.cx-s-1{stroke:var(--cx-1)}.cx-s-2{stroke:var(--cx-2)}\
.cx-s-3{stroke:var(--cx-3)}.cx-s-4{stroke:var(--cx-4)}.cx-s-5{stroke:var(--cx-5)}\
.cx-s-6{stroke:var(--cx-6)}.cx-s-7{stroke:var(--cx-7)}
";

/// Anchors of the sequential map, dark blue to yellow, of rising lightness.
const SEQUENTIAL: [[f64; 3]; 7] = [
    [0.0, 32.0, 77.0],
    [45.0, 67.0, 108.0],
    [87.0, 93.0, 109.0],
    [124.0, 123.0, 120.0],
    [166.0, 157.0, 117.0],
    [211.0, 193.0, 100.0],
    [255.0, 234.0, 70.0],
];

/// Colour at `fraction` (clamped to 0..1) of a map from dark blue to yellow whose
/// lightness rises evenly, so that it survives grey print and any colour vision
/// (the anchors follow cividis; Nuñez, Anderton and Renslow, 2018).
#[must_use]
pub fn sequential_color(fraction: f64) -> [u8; 3] {
    let last = SEQUENTIAL.len() - 1;
    let place = fraction.clamp(0.0, 1.0) * last as f64;
    let index = (place as usize).min(last - 1);
    let t = place - index as f64;
    let (a, b) = (SEQUENTIAL[index], SEQUENTIAL[index + 1]);
    [0, 1, 2].map(|k| (a[k] + t * (b[k] - a[k])).round() as u8)
}

/// Relative luminance of an sRGB colour, 0 to 1 (WCAG 2.2).
pub(super) fn luminance(rgb: [u8; 3]) -> f64 {
    let linear = rgb.map(|c| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(hex: &str) -> [u8; 3] {
        [1, 3, 5].map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap())
    }

    fn contrast(a: f64, b: f64) -> f64 {
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn lightness_of_the_sequential_map_rises() {
        let values: Vec<f64> =
            (0..=100).map(|i| luminance(sequential_color(f64::from(i) / 100.0))).collect();
        assert!(values.windows(2).all(|w| w[1] > w[0] - 1e-3));
        assert!(values[100] - values[0] > 0.7);
    }

    #[test]
    fn every_color_stands_out_from_its_ground() {
        // WCAG asks 4.5 for text; 2.1 keeps the palette's orange, which is
        // always also told by dash and marker.
        for (palette, ground) in [(LIGHT_PALETTE, 1), (DARK_PALETTE, 2)] {
            let pick = |r: &(&'static str, &'static str, &'static str)| {
                if ground == 1 { r.1 } else { r.2 }
            };
            let background = luminance(parse(pick(&ROLES[0])));
            for color in palette {
                let c = contrast(luminance(parse(color)), background);
                assert!(c > 2.1, "{color}: {c}");
            }
            for role in [1, 2, 6] {
                let c = contrast(luminance(parse(pick(&ROLES[role]))), background);
                assert!(c > 4.5, "{}: {c}", ROLES[role].0);
            }
        }
    }

    #[test]
    fn the_stylesheet_agrees_with_the_palettes() {
        for (i, (light, dark)) in LIGHT_PALETTE.iter().zip(DARK_PALETTE).enumerate() {
            assert_eq!(STYLESHEET.matches(&format!("--cx-{i}:{light}")).count(), 2);
            assert_eq!(STYLESHEET.matches(&format!("--cx-{i}:{dark}")).count(), 1);
        }
        assert_eq!(STYLESHEET.matches(&variables(false)).count(), 2);
        assert_eq!(STYLESHEET.matches(&variables(true)).count(), 1);
        for (name, light, dark) in ROLES {
            assert_eq!(STYLESHEET.matches(&format!("--cx-{name}:{light}")).count(), 2);
            assert_eq!(STYLESHEET.matches(&format!("--cx-{name}:{dark}")).count(), 1);
        }
    }
}
