//! Chemical elements: radii and colors.

/// An element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Element {
    /// As in the periodic table.
    pub(super) symbol: &'static str,
    /// Covalent radius of a single bond, ångström.
    pub(super) covalent_radius: f32,
}

/// Elements 1 to 96. Source of the radii: Cordero et al. 2008, *Covalent radii revisited*, Dalton Transactions, table 2; carbon is sp3, and
/// manganese, iron and cobalt have low spin.
const ELEMENTS: [(&str, f32); 96] = [
    ("H", 0.31),
    ("He", 0.28),
    ("Li", 1.28),
    ("Be", 0.96),
    ("B", 0.84),
    ("C", 0.76),
    ("N", 0.71),
    ("O", 0.66),
    ("F", 0.57),
    ("Ne", 0.58),
    ("Na", 1.66),
    ("Mg", 1.41),
    ("Al", 1.21),
    ("Si", 1.11),
    ("P", 1.07),
    ("S", 1.05),
    ("Cl", 1.02),
    ("Ar", 1.06),
    ("K", 2.03),
    ("Ca", 1.76),
    ("Sc", 1.70),
    ("Ti", 1.60),
    ("V", 1.53),
    ("Cr", 1.39),
    ("Mn", 1.39),
    ("Fe", 1.32),
    ("Co", 1.26),
    ("Ni", 1.24),
    ("Cu", 1.32),
    ("Zn", 1.22),
    ("Ga", 1.22),
    ("Ge", 1.20),
    ("As", 1.19),
    ("Se", 1.20),
    ("Br", 1.20),
    ("Kr", 1.16),
    ("Rb", 2.20),
    ("Sr", 1.95),
    ("Y", 1.90),
    ("Zr", 1.75),
    ("Nb", 1.64),
    ("Mo", 1.54),
    ("Tc", 1.47),
    ("Ru", 1.46),
    ("Rh", 1.42),
    ("Pd", 1.39),
    ("Ag", 1.45),
    ("Cd", 1.44),
    ("In", 1.42),
    ("Sn", 1.39),
    ("Sb", 1.39),
    ("Te", 1.38),
    ("I", 1.39),
    ("Xe", 1.40),
    ("Cs", 2.44),
    ("Ba", 2.15),
    ("La", 2.07),
    ("Ce", 2.04),
    ("Pr", 2.03),
    ("Nd", 2.01),
    ("Pm", 1.99),
    ("Sm", 1.98),
    ("Eu", 1.98),
    ("Gd", 1.96),
    ("Tb", 1.94),
    ("Dy", 1.92),
    ("Ho", 1.92),
    ("Er", 1.89),
    ("Tm", 1.90),
    ("Yb", 1.87),
    ("Lu", 1.87),
    ("Hf", 1.75),
    ("Ta", 1.70),
    ("W", 1.62),
    ("Re", 1.51),
    ("Os", 1.44),
    ("Ir", 1.41),
    ("Pt", 1.36),
    ("Au", 1.36),
    ("Hg", 1.32),
    ("Tl", 1.45),
    ("Pb", 1.46),
    ("Bi", 1.48),
    ("Po", 1.40),
    ("At", 1.50),
    ("Rn", 1.50),
    ("Fr", 2.60),
    ("Ra", 2.21),
    ("Ac", 2.15),
    ("Th", 2.06),
    ("Pa", 2.00),
    ("U", 1.96),
    ("Np", 1.90),
    ("Pu", 1.87),
    ("Am", 1.80),
    ("Cm", 1.69),
];

/// Linear RGB after the colors of Corey, Pauling and Koltun, for elements of living things; others are pink.
const COLORS: [(&str, [f32; 3]); 11] = [
    ("H", [0.85, 0.85, 0.85]),
    ("C", [0.12, 0.12, 0.12]),
    ("N", [0.03, 0.08, 0.75]),
    ("O", [0.75, 0.02, 0.02]),
    ("F", [0.15, 0.65, 0.1]),
    ("Cl", [0.05, 0.6, 0.05]),
    ("Br", [0.35, 0.04, 0.02]),
    ("I", [0.2, 0.0, 0.3]),
    ("P", [0.8, 0.25, 0.0]),
    ("S", [0.8, 0.6, 0.02]),
    ("Fe", [0.6, 0.15, 0.02]),
];

/// Linear RGB of other elements.
const OTHER_COLOR: [f32; 3] = [0.6, 0.2, 0.35];

/// The greatest covalent radius of the table.
pub(super) const MAX_COVALENT_RADIUS: f32 = 2.60;

impl Element {
    /// The element of a symbol in any case, or of an atomic number; deuterium and tritium are hydrogen.
    pub(super) fn named(name: &[u8]) -> Option<Self> {
        let name = match name {
            b"D" | b"T" | b"d" | b"t" => b"H",
            name => name,
        };
        let number = || std::str::from_utf8(name).ok()?.parse::<usize>().ok()?.checked_sub(1);
        let position = ELEMENTS.iter().position(|(symbol, _)| symbol.as_bytes().eq_ignore_ascii_case(name));
        let &(symbol, covalent_radius) = ELEMENTS.get(position.or_else(number)?)?;
        Some(Self { symbol, covalent_radius })
    }

    /// Linear RGB.
    pub(super) fn color(self) -> [f32; 3] {
        COLORS.iter().find(|(symbol, _)| *symbol == self.symbol).map_or(OTHER_COLOR, |(_, color)| *color)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_have_symbols_and_numbers() {
        for (name, radius) in [("H", 0.31), ("cl", 1.02), ("FE", 1.32), ("6", 0.76), ("96", 1.69), ("D", 0.31)] {
            assert_eq!(Element::named(name.as_bytes()).unwrap().covalent_radius, radius, "{name}");
        }
        for name in ["", "Xx", "0", "97", "-1"] {
            assert_eq!(Element::named(name.as_bytes()), None, "{name}");
        }
        assert!(ELEMENTS.iter().all(|(_, radius)| *radius <= MAX_COVALENT_RADIUS));
        assert!(COLORS.iter().all(|(symbol, _)| Element::named(symbol.as_bytes()).is_some()));
    }
}
