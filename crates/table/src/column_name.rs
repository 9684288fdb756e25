//! Reads quantity and place from the name of a column.

use crate::name_parts::{Measured, Tag, Token, Word, parts_of, split_tag};
use mapper_core::Channel;

/// A place of a turbocharger.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// 1 and 2 before and after the compressor, 3 and 4 before and after the turbine.
    Station(u32),
    /// The compressor or its housing.
    Compressor,
    /// The turbine or its housing.
    Turbine,
    /// The shaft.
    Shaft,
    /// The oil that enters.
    Oil,
    /// The oil that leaves.
    OilOut,
    /// The test cell.
    Ambient,
    /// A wall of an unknown machine.
    Housing,
    /// Not named.
    Unnamed,
}

/// Certainty of a place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Clarity {
    /// A usual meaning of a word that has others.
    Vague,
    /// A short form that other programs use differently.
    Short,
    /// Machine and side, or the usual number of a station.
    Clear,
}

/// The parts of a column's name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColumnName {
    tokens: Vec<Token>,
    tag: Option<Tag>,
}

/// Maximum number of letters of a name that are evaluated. Bound: limits the time for any name.
const MAX_NAME_LETTERS: usize = 120;

impl ColumnName {
    /// Reads a name.
    pub fn read(name: &str) -> ColumnName {
        let name: String = name.trim().chars().take(MAX_NAME_LETTERS).collect();
        // `Tc_in` is T before the compressor, `TC` alone the turbocharger.
        let is_tc = |side: &str| matches!(side.trim_start_matches(['_', '-', ' ']), "in" | "out");
        let name = match name.to_lowercase().strip_prefix("tc") {
            Some(side) if is_tc(side) => format!("t c {side}"),
            _ => name,
        };
        let (tag, rest) = split_tag(&name).map_or((None, name.as_str()), |(tag, rest)| (Some(tag), rest));
        ColumnName { tokens: parts_of(rest), tag }
    }

    /// Whether a word has this meaning.
    pub fn has(&self, word: Word) -> bool {
        self.tokens.iter().any(|token| token.is(word))
    }

    /// Whether the name is a tag number of a piping diagram, which has the quantity and no place.
    pub fn is_tag(&self) -> bool {
        self.tag.is_some()
    }

    /// The quantity of a tag number, and the number of its loop.
    pub fn tag(&self) -> Option<(Measured, u32)> {
        self.tag.map(|tag| (tag.measured, tag.number))
    }

    /// Whether every part of it is known.
    pub fn is_known(&self) -> bool {
        !self.tokens.contains(&Token::Unknown)
    }

    /// Number of its parts.
    pub fn part_count(&self) -> usize {
        self.tokens.len()
    }

    /// Whether the column belongs to another part of the stand or engine, or is a difference, a limit or an uncertainty.
    pub fn is_other(&self) -> bool {
        let stations = |quantity: char| {
            let is_place = |pair: &&[Token]| matches!(pair, [Token::Letter(letter), Token::Number(_)] if *letter == quantity);
            self.tokens.windows(2).filter(is_place).count()
        };
        // `T2-T1`, `u(T2)`, `dT2`.
        let is_marked =
            matches!(self.tokens.get(..2), Some([Token::Letter('u' | 'd'), Token::Letter('t' | 'p')]));
        is_marked
            || stations('t') > 1
            || self.has(Word::Other) && !self.is_before_cooler()
            || self.has(Word::Bearing) && !self.has(Word::Oil)
            || self.has(Word::Manifold) && !self.has(Word::Exhaust)
    }

    /// Whether the place is between compressor and charge air cooler.
    fn is_before_cooler(&self) -> bool {
        let is_only = |token: &Token| !token.is(Word::Other) || token.is(Word::Cooler);
        self.has(Word::Cooler)
            && (self.has(Word::Before) || self.has(Word::In))
            && !self.has(Word::Oil)
            && self.tokens.iter().all(is_only)
    }

    /// Whether the name is that of a setpoint: `w` after the quantity is the German symbol for it.
    pub fn is_command(&self) -> bool {
        self.has(Word::Command) || self.tokens.iter().skip(1).any(|token| *token == Token::Letter('w'))
    }

    /// Whether the stand computed the value. A static temperature cannot be measured.
    pub fn is_computed(&self) -> bool {
        self.has(Word::Corrected)
            || self.has(Word::Computed)
            || self.has(Word::Static) && self.measured() == Some(Measured::Temperature)
    }

    /// The quantity; `None` if the name has none, or several.
    pub fn measured(&self) -> Option<Measured> {
        let has_pressure = [Word::Is(Measured::Pressure), Word::Compression, Word::Expansion]
            .iter()
            .any(|word| self.has(*word));
        if self.has(Word::Ratio) && has_pressure || self.pressure_stations().count() > 1 {
            return Some(Measured::PressureRatio);
        }
        if self.has(Word::Is(Measured::VolumeFlow)) {
            return Some(Measured::VolumeFlow);
        }
        let mut words = self.tokens.iter().filter_map(|token| token.measured());
        if let Some(first) = words.next() {
            let in_front = self.tokens.first().and_then(|token| token.measured());
            let opening = || self.has(Word::Is(Measured::Opening)).then_some(Measured::Opening);
            return if words.all(|other| other == first) { Some(first) } else { in_front.or_else(opening) };
        }
        // In `T_C_n_Verd` the quantity comes first, in `Compressor T out` after the machine.
        let in_front = self.tokens.first().and_then(|token| token.letter());
        in_front
            .or(self.tag.map(|tag| tag.measured))
            .or_else(|| self.tokens.get(self.letter_behind_machine()?)?.letter())
    }

    /// Station numbers after pressures: `p2/p1` has two.
    fn pressure_stations(&self) -> impl Iterator<Item = u32> + '_ {
        self.tokens.windows(2).filter_map(|pair| match pair {
            [Token::Letter('p'), Token::Number(number)] => Some(*number),
            [token, Token::Number(number)] if token.measured() == Some(Measured::Pressure) => Some(*number),
            _ => None,
        })
    }

    /// Whether words or stations refer to the turbine. A letter is not enough: `t` may also mean total.
    pub fn is_of_turbine(&self) -> bool {
        self.has(Word::Turbine) && !self.has(Word::Compressor)
            || self.has(Word::Expansion)
            || self.pressure_stations().any(|number| matches!(number, 3 | 4))
    }

    fn letter_behind_machine(&self) -> Option<usize> {
        let pair = self.tokens.windows(2).position(|pair| {
            (pair[0].is_machine() || pair[0].is(Word::In) || pair[0].is(Word::Out))
                && matches!(pair[1], Token::Letter('t' | 'p'))
        });
        pair.map(|at| at + 1)
    }

    /// Index of the part with the quantity.
    fn quantity(&self) -> Option<usize> {
        let word = self.tokens.iter().position(|token| token.measured().is_some());
        word.or_else(|| self.tokens.first()?.letter().map(|_| 0)).or_else(|| self.letter_behind_machine())
    }

    /// The place of a quantity, and how certain it is.
    pub fn place(&self, measured: Measured) -> Option<(Place, Clarity)> {
        match measured {
            Measured::Speed => self.place_of_speed(),
            Measured::Flow | Measured::VolumeFlow => self.place_of_flow(),
            Measured::Opening => Some((Place::Unnamed, Clarity::Clear)),
            _ => self.place_of_state(measured),
        }
    }

    fn place_of_speed(&self) -> Option<(Place, Clarity)> {
        if self.has(Word::Shaft) || self.has(Word::Compressor) {
            let has_quantity = self.measured().is_some();
            return Some((Place::Shaft, if has_quantity { Clarity::Clear } else { Clarity::Vague }));
        }
        let alone = self.tokens.iter().all(|token| {
            token.measured() == Some(Measured::Speed)
                || token.is(Word::Turbine)
                || matches!(token, Token::Number(1) | Token::Letter('n' | 'l'))
        });
        (self.tag.is_some() || alone).then_some((Place::Unnamed, Clarity::Short))
    }

    fn place_of_flow(&self) -> Option<(Place, Clarity)> {
        if self.has(Word::Oil) {
            return Some((Place::Oil, Clarity::Clear));
        }
        let (machine, _) = self.machine();
        if machine == Some(Place::Turbine) || self.has(Word::Exhaust) {
            return Some((Place::Turbine, Clarity::Clear));
        }
        if machine == Some(Place::Compressor) || self.has(Word::Air) && self.measured().is_some() {
            return Some((Place::Compressor, Clarity::Clear));
        }
        match self.station() {
            Some((1 | 2, _)) => Some((Place::Compressor, Clarity::Vague)),
            Some((3 | 4, _)) => Some((Place::Turbine, Clarity::Vague)),
            Some(_) => None,
            None if self.tag.is_some() || self.is_known() => Some((Place::Unnamed, Clarity::Vague)),
            None => None,
        }
    }

    /// Place of a pressure, temperature, ratio or efficiency.
    fn place_of_state(&self, measured: Measured) -> Option<(Place, Clarity)> {
        let (machine, by_letter) = self.machine();
        let of_machine =
            |compressor, turbine| if machine == Some(Place::Turbine) { turbine } else { compressor };
        let (is_in, is_out) = self.sides(machine.is_some());
        if self.has(Word::Oil) {
            return Some((if is_out { Place::OilOut } else { Place::Oil }, Clarity::Clear));
        }
        if self.has(Word::Housing) {
            return Some(match machine {
                Some(machine) => (machine, Clarity::Clear),
                None => (Place::Housing, Clarity::Vague),
            });
        }
        if self.is_before_cooler() {
            return Some((Place::Station(2), Clarity::Vague));
        }
        // `EGT 2` is the second probe.
        let is_gas = self.has(Word::Exhaust) || self.has(Word::Charge);
        let station = self.station().filter(|(_, clarity)| !is_gas || *clarity == Clarity::Clear);
        if machine.is_some() && is_in != is_out {
            let place = if is_in { of_machine(1, 3) } else { of_machine(2, 4) };
            let agrees = station.is_none_or(|(number, _)| number == place || number > 4);
            let clarity = match self.has(Word::Acronym) {
                true if self.tokens.len() == 1 => Clarity::Short,
                false if agrees => Clarity::Clear,
                _ => Clarity::Vague,
            };
            return Some((Place::Station(place), clarity));
        }
        if let Some((number, clarity)) = station {
            // `P0`, `P_0`: the barometer.
            if number == 0 && measured == Measured::Pressure {
                return Some((Place::Ambient, Clarity::Vague));
            }
            return self.place_of_station(number, clarity, machine, by_letter);
        }
        if self.has(Word::Ambient) {
            return Some((Place::Ambient, Clarity::Clear));
        }
        if let (1, Some(Token::Word(words))) = (self.tokens.len(), self.tokens.first()) {
            match words {
                // The acronym of the turbine's outlet temperature.
                [Word::Total] => return Some((Place::Station(4), Clarity::Short)),
                [Word::Shaft] => return Some((Place::Compressor, Clarity::Clear)),
                [Word::Is(Measured::Temperature), Word::Total] => {
                    return Some((Place::Turbine, Clarity::Clear));
                }
                _ => {}
            }
        }
        match (machine, measured) {
            // `T_c` is the housing; `p_c` and `p_t` are usually the compressor's outlet and the turbine's inlet.
            (Some(machine), Measured::Temperature) if by_letter && self.tokens.len() == 2 => {
                return Some((machine, Clarity::Clear));
            }
            (Some(_), Measured::Pressure) if by_letter && self.tokens.len() == 2 => {
                return Some((Place::Station(of_machine(2, 3)), Clarity::Vague));
            }
            (Some(_), _) => return None,
            (None, _) => {}
        }
        let vague = |station| Some((Place::Station(station), Clarity::Vague));
        match (self.has(Word::Exhaust), self.has(Word::Charge), is_in, is_out) {
            (true, _, _, false) if self.has(Word::Before) || !self.has(Word::Back) => vague(3),
            (false, true, ..) => vague(2),
            (false, false, true, false) if self.is_known() => vague(1),
            (false, false, false, true) if self.is_known() => vague(2),
            _ => None,
        }
    }

    fn place_of_station(
        &self,
        number: u32,
        clarity: Clarity,
        machine: Option<Place>,
        by_letter: bool,
    ) -> Option<(Place, Clarity)> {
        // `P1T`, and `p_t1` less surely, are before the turbine.
        let is_behind =
            self.tokens.windows(2).any(|pair| matches!(pair, [Token::Number(_), Token::Letter('t')]));
        match (number, machine) {
            (1 | 2, Some(Place::Turbine)) => {
                let clarity = if by_letter && !is_behind { Clarity::Vague } else { clarity };
                Some((Place::Station(number + 2), clarity))
            }
            (3 | 4, Some(Place::Compressor)) => None,
            (1..=4, _) => Some((Place::Station(number), clarity)),
            // The second digit counts the readings of a station.
            (11, _) => Some((Place::Station(1), Clarity::Vague)),
            (21 | 22, _) => Some((Place::Station(2), Clarity::Vague)),
            (31, _) => Some((Place::Station(3), Clarity::Vague)),
            (41, _) => Some((Place::Station(4), Clarity::Vague)),
            _ => None,
        }
    }

    /// Whether the name has the number 21, which in some logs is before the compressor.
    pub fn may_be_inlet(&self) -> bool {
        self.has_station(21)
    }

    /// Whether the name has this number after its quantity.
    pub fn has_station(&self, number: u32) -> bool {
        self.station().is_some_and(|(own, _)| own == number)
    }

    /// Number of the station: after the quantity, or after the letter of a machine.
    fn station(&self) -> Option<(u32, Clarity)> {
        let quantity = self.quantity();
        let is_letter = |at: usize| matches!(self.tokens.get(at), Some(Token::Letter(_)));
        let is_total = |at: usize| {
            self.tokens.get(at).is_some_and(|token| token.is(Word::Total) || token.is(Word::Static))
        };
        self.tokens.iter().enumerate().find_map(|(at, token)| {
            let Token::Number(number) = token else { return None };
            let mut before = at.checked_sub(1)?;
            // `T_tot_1`, `pstat2`.
            if quantity.is_some_and(|quantity| quantity + 1 == before) && is_total(before) {
                before -= 1;
            }
            let clarity = match self.tokens.get(before)? {
                _ if quantity == Some(before) && (is_letter(before) || is_total(before)) => Clarity::Clear,
                _ if quantity == Some(before) => Clarity::Vague,
                // `T_c1`, `Compressor outlet T2`.
                Token::Letter('c' | 't' | 'p') => Clarity::Clear,
                _ => return None,
            };
            Some((*number, clarity))
        })
    }

    /// The machine, and whether a letter alone names it.
    fn machine(&self) -> (Option<Place>, bool) {
        let words = (self.has(Word::Compressor), self.has(Word::Turbine));
        let letter = |c: char| {
            let quantity = self.quantity().unwrap_or_default();
            // In `Inlet Temperature T1` the letter is the quantity's symbol.
            let is_symbol = |at: usize| {
                matches!(self.tokens.get(at + 1), Some(Token::Number(_)))
                    && self.tokens.get(quantity).and_then(|token| token.measured()).is_some_and(|measured| {
                        Token::Letter(c).letter() == Some(measured) && at == quantity + 1
                    })
            };
            let is_machine =
                |(at, token): (usize, &Token)| at > quantity && *token == Token::Letter(c) && !is_symbol(at);
            self.tokens.iter().enumerate().any(is_machine)
        };
        match words {
            (true, false) => (Some(Place::Compressor), false),
            (false, true) => (Some(Place::Turbine), false),
            (true, true) => (None, false),
            (false, false) if self.sides_of_letters().is_some_and(|(_, turbine)| turbine) => {
                (Some(Place::Turbine), true)
            }
            (false, false) if self.sides_of_letters().is_some() => (Some(Place::Compressor), true),
            (false, false) if letter('c') || letter('v') && self.has(Word::Housing) => {
                (Some(Place::Compressor), true)
            }
            (false, false) if letter('t') => (Some(Place::Turbine), true),
            (false, false) => (None, false),
        }
    }

    /// `T_vV`, `p_nT`: before or after the compressor (Verdichter) or turbine; whether after, and whether of the turbine.
    fn sides_of_letters(&self) -> Option<(bool, bool)> {
        let quantity = self.quantity()?;
        let pair = self.tokens.get(quantity + 1..)?.windows(2).find_map(|pair| match pair {
            [Token::Letter(side @ ('v' | 'n')), Token::Letter(machine @ ('v' | 't'))] => {
                Some((*side == 'n', *machine == 't'))
            }
            _ => None,
        });
        pair.filter(|_| !self.tokens.iter().any(|token| token.is_machine()))
    }

    /// Whether the name has an inlet, and whether it has an outlet; with `has_machine`, `before` and `after` count too.
    fn sides(&self, has_machine: bool) -> (bool, bool) {
        if let Some((is_after, _)) = self.sides_of_letters() {
            return (!is_after, is_after);
        }
        let quantity = self.quantity().unwrap_or_default();
        let (mut before, mut after) =
            (has_machine && self.has(Word::Before), has_machine && self.has(Word::After));
        let (mut is_in, mut is_out) = (self.has(Word::In), self.has(Word::Out));
        for (at, token) in self.tokens.iter().enumerate().skip(quantity + 1) {
            let next = self.tokens.get(at + 1);
            let is_machine_next = next.is_some_and(|next| next.is_machine());
            match token {
                Token::Letter('v') if is_machine_next => before = true,
                Token::Letter('n') if is_machine_next => after = true,
                Token::Letter('e' | 'i') if has_machine => is_in = true,
                // `p_A_v_Turb`: the exhaust gas.
                Token::Letter('a') if matches!(next, Some(Token::Letter('v' | 'n'))) => {}
                Token::Letter('a' | 'o') if has_machine => is_out = true,
                _ => {}
            }
        }
        if before != after { (before, after) } else { (is_in, is_out) }
    }
}

/// The channel of a quantity at a place.
pub fn channel_at(measured: Measured, place: Place) -> Option<Channel> {
    let (pressures, temperatures) = (
        [Channel::P1, Channel::P2, Channel::P3, Channel::P4],
        [Channel::T1, Channel::T2, Channel::T3, Channel::T4],
    );
    let at = |channels: [Channel; 4], station: u32| channels.get((station as usize).checked_sub(1)?).copied();
    match (measured, place) {
        (Measured::Pressure, Place::Station(station)) => at(pressures, station),
        (Measured::Temperature, Place::Station(station)) => at(temperatures, station),
        (Measured::Temperature, Place::Compressor | Place::Housing) => Some(Channel::Tc),
        (Measured::Temperature, Place::Turbine) => Some(Channel::Tt),
        (Measured::Temperature, Place::Oil) => Some(Channel::TOil),
        (Measured::Temperature, Place::OilOut) => Some(Channel::TOilOut),
        (Measured::Temperature, Place::Ambient) => Some(Channel::TAmb),
        (Measured::Speed, Place::Shaft | Place::Unnamed) => Some(Channel::ShaftSpeed),
        (Measured::Flow, Place::Compressor | Place::Unnamed) => Some(Channel::CompressorFlow),
        (Measured::Flow, Place::Turbine) => Some(Channel::TurbineFlow),
        (Measured::Flow, Place::Oil) => Some(Channel::OilFlow),
        (Measured::Opening, _) => Some(Channel::ValveCommand),
        _ => None,
    }
}

pub(crate) fn is_known_word(word: &str) -> bool {
    let name = ColumnName::read(word);
    name.is_known()
        && name.part_count() > 0
        && name.tokens.iter().all(|token| matches!(token, Token::Word(_)))
}
