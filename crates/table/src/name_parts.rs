//! Parts of the name of a column, and the words in them.

use Measured::{
    Efficiency, Flow, Humidity, Opening, Pressure, PressureRatio, Speed, Temperature, Vane, VolumeFlow,
};
use Word::{
    Acronym, After, Air, Ambient, Back, Bearing, Before, Charge, Command, Compression, Compressor, Computed,
    Cooler, Corrected, Dew, Engine, Exhaust, Expansion, Filler, Housing, In, Is, Manifold, Oil, Other, Out,
    Ratio, Shaft, Static, Total, Turbine,
};
use std::collections::HashMap;
use std::sync::LazyLock;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Token {
    Word(&'static [Word]),
    Letter(char),
    Number(u32),
    Unknown,
}

impl Token {
    pub(crate) fn is(self, word: Word) -> bool {
        matches!(self, Token::Word(words) if words.contains(&word))
    }

    pub(crate) fn is_machine(self) -> bool {
        self.is(Word::Compressor) || self.is(Word::Turbine)
    }

    pub(crate) fn measured(self) -> Option<Measured> {
        let Token::Word(words) = self else { return None };
        words.iter().find_map(|word| if let Word::Is(measured) = word { Some(*measured) } else { None })
    }

    /// The quantity of a letter at the start of a name.
    pub(crate) fn letter(self) -> Option<Measured> {
        match self {
            Token::Letter('t') => Some(Measured::Temperature),
            Token::Letter('p') => Some(Measured::Pressure),
            Token::Letter('n') => Some(Measured::Speed),
            Token::Letter('m' | 'w') => Some(Measured::Flow),
            Token::Letter('v' | 'q') => Some(Measured::VolumeFlow),
            _ => None,
        }
    }
}

pub(crate) fn parts_of(name: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    for part in normalise(name).split('_').filter(|part| !part.is_empty()) {
        push_part(&mut tokens, part);
    }
    tokens
}

/// The name in lower case, umlauts spelled out, without accents, with `_` for everything but letters and digits and between the words of
/// `compInletTemp`.
fn normalise(text: &str) -> String {
    let mut normalised = String::new();
    let mut letters = text.chars().peekable();
    let mut was_small = false;
    while let Some(letter) = letters.next() {
        if was_small && letter.is_uppercase() && letters.peek().is_some_and(|next| next.is_lowercase()) {
            normalised.push('_');
        }
        was_small = letter.is_lowercase();
        for letter in letter.to_lowercase() {
            match letter {
                'ä' | 'æ' => normalised.push_str("ae"),
                'ö' | 'ø' => normalised.push_str("oe"),
                'ü' => normalised.push_str("ue"),
                'ß' => normalised.push_str("ss"),
                'à' | 'á' | 'â' | 'ã' | 'å' | 'ą' => normalised.push('a'),
                'è' | 'é' | 'ê' | 'ę' | 'ě' => normalised.push('e'),
                'ì' | 'í' | 'î' => normalised.push('i'),
                'ò' | 'ó' | 'ô' | 'õ' => normalised.push('o'),
                'ù' | 'ú' | 'û' | 'ů' => normalised.push('u'),
                'ç' | 'ć' | 'č' => normalised.push('c'),
                'ñ' | 'ń' | 'ň' => normalised.push('n'),
                'ý' => normalised.push('y'),
                'ř' => normalised.push('r'),
                'ť' => normalised.push('t'),
                'ś' | 'š' => normalised.push('s'),
                'ż' | 'ź' | 'ž' => normalised.push('z'),
                'ł' => normalised.push('l'),
                'ё' => normalised.push('е'),
                letter if letter.is_alphanumeric() => normalised.push(letter),
                _ if normalised.ends_with('_') => {}
                _ => normalised.push('_'),
            }
        }
    }
    // German compounds: `Eintrittsdruck`.
    normalised.replace("eintritts", "eintritt_").replace("austritts", "austritt_")
}

/// Whether a script has words without blanks between them.
fn is_unspaced(letter: char) -> bool {
    matches!(letter, '\u{3040}'..='\u{30ff}' | '\u{4e00}'..='\u{9fff}')
}

/// Maximum length of a compound, bytes. Bound: twice that of the longest German words. It limits the time for any name.
const MAX_WORD_BYTES: usize = 64;

/// Adds the letters and numbers of a part between blanks.
fn push_part(tokens: &mut Vec<Token>, part: &str) {
    let class = |c: char| (c.is_ascii_digit(), is_unspaced(c));
    let mut rest = part;
    while let Some(first) = rest.chars().next() {
        let end = rest.find(|c| class(c) != class(first)).unwrap_or(rest.len());
        let (piece, tail) = rest.split_at(end);
        rest = tail;
        if first.is_ascii_digit() {
            tokens.push(piece.parse().map_or(Token::Unknown, Token::Number));
        } else if let Some(words) = meanings(piece) {
            tokens.push(Token::Word(words));
        } else if piece.len() == 1 || ["vv", "nv", "vt", "nt"].contains(&piece) {
            tokens.extend(piece.chars().map(Token::Letter));
        } else if piece.len() > MAX_WORD_BYTES {
            tokens.push(Token::Unknown);
        } else if let Some(parts) = compound(piece) {
            tokens.extend(parts);
        } else {
            push_known_stems(tokens, piece);
        }
    }
}

/// Short words that count at the start or end of a compound: `prcomp`, `etats`, `tcompin`, `ntc`.
const SHORT_STARTS: [&str; 6] = ["pr", "pi", "nc", "mc", "wc", "mf"];
const SHORT_ENDS: [&str; 5] = ["in", "ts", "tt", "tc", "tl"];

/// The parts of a compound, if all are known: `luftmassenstrom`, `tcompin`, `mdotc`.
fn compound(text: &str) -> Option<Vec<Token>> {
    const LINK: &[Word] = &[Word::Filler];
    let places: Vec<usize> = text.char_indices().map(|(at, _)| at).chain([text.len()]).collect();
    // The first part of the rest of the text, from each place.
    let mut known: Vec<Option<(usize, Token)>> = vec![None; text.len() + 1];
    for (index, &start) in places.iter().enumerate().rev() {
        for &end in places[index + 1..].iter().rev() {
            let (is_start, is_end) = (start == 0, end == text.len());
            if !is_end && known[end].is_none() {
                continue;
            }
            let piece = &text[start..end];
            let letter =
                piece.chars().next().filter(|first| piece.len() == first.len_utf8() && first.is_ascii());
            let before_side =
                !is_end && known[end].is_some_and(|(_, next)| next.is(Word::In) || next.is(Word::Out));
            let token = match letter {
                Some(letter @ ('t' | 'p' | 'n' | 'm' | 'w' | 'v')) if is_start => Some(Token::Letter(letter)),
                Some(letter @ ('c' | 't')) if is_end || before_side => Some(Token::Letter(letter)),
                Some('s' | 'n') if !is_start && !is_end => Some(Token::Word(LINK)),
                Some(_) => None,
                None if piece == "is" && is_end => Some(Token::Word(LINK)),
                None if piece.len() > 2
                    || is_start && SHORT_STARTS.contains(&piece)
                    || is_end && SHORT_ENDS.contains(&piece) =>
                {
                    meanings(piece).map(Token::Word)
                }
                None => None,
            };
            if let Some(token) = token {
                known[start] = Some((end, token));
                break;
            }
        }
    }
    let (mut parts, mut at) = (Vec::new(), 0);
    while at < text.len() {
        let (end, token) = known[at]?;
        parts.push(token);
        at = end;
    }
    Some(parts)
}

/// Adds the known words of at least four letters within an unknown word, such as inflected forms and compounds.
fn push_known_stems(tokens: &mut Vec<Token>, text: &str) {
    let places: Vec<usize> = text.char_indices().map(|(at, _)| at).chain([text.len()]).collect();
    let (mut index, mut is_known) = (0, true);
    while index + 1 < places.len() {
        // An ending: `давление`, `pressures`.
        if index > 0 && is_known && places.len() - 1 - index <= 3 {
            return;
        }
        let start = places[index];
        let is_word = |end: &usize| {
            let piece = &text[start..places[*end]];
            (piece.starts_with(is_unspaced) || *end - index >= 4) && meanings(piece).is_some()
        };
        match (index + 1..places.len()).rev().find(is_word) {
            Some(end) => {
                tokens.extend(meanings(&text[start..places[end]]).map(Token::Word));
                index = end;
            }
            None => (index, is_known) = (index + 1, false),
        }
    }
    if !is_known {
        tokens.push(Token::Unknown);
    }
}

/// Tags with another meaning if their number is short: `PT2` is the total pressure at station 2, `TIT 1` a turbine inlet temperature.
const LONG_NUMBERS: [&str; 6] = ["tt", "pt", "pi", "pit", "tit", "st"];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tag {
    pub(crate) measured: Measured,
    pub(crate) number: u32,
}

/// The tag number at the start of a name, and the rest of the name.
pub(crate) fn split_tag(name: &str) -> Option<(Tag, &str)> {
    let letters = name.find(|c: char| !c.is_ascii_alphabetic())?;
    let (code, rest) = name.split_at(letters);
    let code = code.to_ascii_lowercase();
    let mut functions = code.chars();
    // `PT100` is a resistance thermometer, `PT-100` a tag.
    let is_thermometer = code == "pt" && ["100", "500", "1000"].iter().any(|ohms| rest.starts_with(ohms));
    let measured = match functions.next()? {
        'p' if is_thermometer => Measured::Temperature,
        't' => Measured::Temperature,
        'p' => Measured::Pressure,
        'f' => Measured::Flow,
        's' => Measured::Speed,
        _ => return None,
    };
    // Transmitter, element, indicator, recorder; `D` is a difference, `V` a valve.
    if !(1..=2).contains(&functions.as_str().len()) || !functions.all(|letter| "teir".contains(letter)) {
        return None;
    }
    let number = rest.trim_start_matches(['-', '_', ' ', '.']);
    let digits = number.find(|c: char| !c.is_ascii_digit()).unwrap_or(number.len());
    let suffix = number[digits..].trim_start_matches(|c: char| c.is_ascii_uppercase());
    let ends = suffix.is_empty() || suffix.starts_with(|c: char| !c.is_alphanumeric());
    let least = if LONG_NUMBERS.contains(&code.as_str()) { 3 } else { 1 };
    let loop_number = number[..digits].parse().ok()?;
    (ends && (least..=5).contains(&digits)).then_some((Tag { measured, number: loop_number }, suffix))
}

/// A quantity that a name may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the quantities")]
pub enum Measured {
    Temperature,
    Pressure,
    Speed,
    Flow,
    VolumeFlow,
    PressureRatio,
    Efficiency,
    Humidity,
    Opening,
    Vane,
}

/// Meaning of a word in a name.
///
/// `Ratio` is a pressure ratio if the name contains a pressure. `Shaft` is also the turbocharger as a whole. `Exhaust` and `Air` are the
/// gases of turbine and compressor, and `Charge` is the compressed air. `Other` is any other part of the stand, a difference, a limit or an
/// uncertainty; `Engine` always has `Other` too. `Back` is the pressure behind a machine, seldom before a turbine. `Acronym` marks abbreviations such as CIT (compressor inlet temperature).
#[allow(missing_docs, reason = "the names are words of the table")]
#[rustfmt::skip]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    Is(Measured), Ratio, Compression, Expansion,
    Compressor, Turbine, Shaft, Exhaust, Air, Charge, Oil, Housing, Bearing, Ambient, Dew, Engine, Manifold, Cooler, Other,
    In, Out, Before, After, Acronym,
    Total, Static, Corrected, Computed, Command, Back, Filler,
}

/// Words without accents, umlauts as two letters. Words of one or two letters count alone, or at an end of a compound.
#[rustfmt::skip]
const TABLE: &[(&[Word], &str)] = &[
    (&[Is(Temperature)], "temp tmp temperature temperatur temperatura temperatuur teplota темп температур 温度 温"),
    (&[Is(Temperature), Total], "tt"),
    (&[Is(Temperature), Static], "ts"),
    (&[Is(Temperature), Exhaust], "egt"),
    (&[Is(Temperature), Compressor, In, Acronym], "cit"),
    (&[Is(Temperature), Compressor, Out, Acronym], "cot cdt"),
    (&[Is(Temperature), Turbine, In, Acronym], "tit"),
    (&[Is(Pressure), Compressor, In, Acronym], "cip"),
    (&[Is(Pressure), Compressor, Out, Acronym], "cop cdp"),
    (&[Is(Pressure), Turbine, In, Acronym], "tip"),
    (&[Is(Pressure), Turbine, Out, Acronym], "top"),
    (&[Is(Pressure)], "press prs pressure druck pression presion pressione pressao druk tryck cisnienie cisnien cisnienia tlak давлен 压力 气压 压 圧力 圧"),
    (&[Is(Pressure), Total], "pt"),
    (&[Is(Pressure), Static], "ps"),
    (&[Is(Pressure), Charge], "ladedruck laddtryck laaddruk 過給圧"),
    (&[Is(Pressure), Ambient], "luftdruck lufttryck luchtdruk ilmanpaine baro pbar barometer barometric barometrisch barometerdruck барометр барометрическ 大气压 大气压力 大気圧 気圧"),
    (&[Is(Speed)], "speed spd drehzahl rpm vitesse regime velocidad velocita giri rotacao toerental varvtal rotation rotations rotational umdrehungen predkosc obroty otacky omega оборот вращен 转速 回転数 回転速度"),
    (&[Is(Speed), Corrected], "nc"),
    (&[Is(Flow)], "flow massflow mass massflowrate massrate massenstrom massenfluss durchsatz massendurchsatz debit caudal portata vazao gasto massastroom massique masico massico massica massa masa fluxo flujo flusso debiet floede fm masy strumien przeplyw prutok mdot dm mf расход 流量 质量流量 質量流量"),
    (&[Is(Flow), Compressor], "mc wc mv ml ma wa massc"),
    (&[Is(Flow), Turbine], "mt wt"),
    (&[Is(Flow), Air], "maf caf luftmasse"),
    (&[Is(VolumeFlow)], "volume volumen volumetric volumique volumica volumetrico volumetrica volumenstrom volflow vdot volumenfluss объем 体积流量 体积 容积流量"),
    (&[Is(PressureRatio)], "pr prss pratio pressratio pi pik π druckverh druckverhaeltnis ladedruckverhaeltnis sprez 压比 增压比 压力比 压缩比 圧力比"),
    (&[Is(PressureRatio), Expansion], "er 膨胀比 落压比"),
    (&[Is(Efficiency)], "eta η eff effic efficiency wirkungsgrad rendement rendimiento rendimento eficiencia efficienza sprawnosc ucinnost verkningsgrad virkningsgrad hyoetysuhde кпд 效率 効率"),
    (&[Is(Humidity)], "rh humidity humid relhum feuchte luftfeuchte humedad umidita humidite humidade wilgotnosc влажност 湿度"),
    (&[Is(Temperature), Dew], "dew dewpoint taupunkt rosee rocio rugiada orvalho rosy росы 露点"),
    (&[Is(Opening)], "valve ventil klappe drossel drosselklappe bpv opening oeffnung vanne valvola valvula клапан 阀门 阀 开度 背压阀"),
    (&[Is(Vane)], "vane vanes vgt vtg vnt rack nozzle leitschaufel leitapparat wastegate 导叶"),
    (&[Ratio], "ratio verhaeltnis rapport taux relacion relacao rapporto razao verhouding foerhallande forhold stosunek отношени степен"),
    (&[Compression], "compression compressione compresion kompression"),
    (&[Expansion], "expansion detente espansione entspannung"),
    (&[Compressor], "comp compr cmp cmpr compressor verd verdichter kompressor kompresor sprezarka sprezarki lader compresseur compresor compressore компрессор 压气机 压缩机 压气 圧縮機 コンプレッサ"),
    (&[Turbine], "tur turb turbine turbinen turbina turbiny turbin турбин 涡轮 涡轮机 透平 タービン"),
    (&[Shaft], "tc tl atl turbo turbocharger turbolader abgasturbolader turbocompressore shaft rotor spool gg laeufer welle arbre eje ротор турбокомпрессор 涡轮增压器 增压器 转子 ターボ 過給機 ткр"),
    (&[Exhaust], "abgas exh exhaust gas hotgas echappement scarico выхлоп 排气 废气 燃气"),
    (&[Air], "air luft aire aria ar lucht powietrza powietrze воздух 空气 空気"),
    (&[Charge], "boost ladeluft doladowania"),
    (&[Oil], "oil oel huile aceite olio oleo olej olie olje масл 机油 滑油 润滑油 潤滑油 油"),
    (&[Housing], "housing hsg casing wall skin metal wand geh gehaeuse gehause body material carter carcasa carcassa paroi pared корпус 壳体 蜗壳 外壳 壳"),
    (&[Bearing], "bearing lager lagergehaeuse palier cojinete подшипник 轴承 轴承体"),
    (&[Ambient], "amb ambient ambiant ambiante ambiente umg umgebung omgivning omgeving otoczenia otoczenie room raum cell zelle testbed pruefstand atm atmospheric atmospherique atmosphere atmosferica atmosferico atmosferische atmosferisk atmosferyczne atmosfericky atmosfaer окружающ атмосферн 环境 大气 大気"),
    (&[In], "in inl inlet inlaat intake suc suct ein eintritt ansaug suction entree entry entrada entrata ingresso admission admision aspiration wlot wlotu вход входе 进口 入口 进 吸入"),
    (&[In, Air], "进气"),
    (&[Compressor, In], "压前"),
    (&[Compressor, Out], "压后"),
    (&[Turbine, In], "涡前"),
    (&[Turbine, Out], "涡后"),
    (&[Out], "out outl outlet disch dis aus austritt discharge exit sortie salida saida uscita wylot wylotu выход выходе 出口 出"),
    (&[Before], "vor before upstream us pre avant amont antes voor foere monte przed перед 前"),
    (&[After], "nach hinter after behind downstream ds post apres aval despues na efter valle za за после 后 後"),
    (&[Total], "tot total totale ges gesamt stagnation полн 总"),
    (&[Static], "stat static statisch statique statica статическ 静"),
    (&[Corrected], "cor corr corrected korr korrigiert corrige corrigee corregido corretto red reduced reduziert reduit reduite ridotta ridotto kor привед 折合 换算 修正 修正後"),
    (&[Computed], "ideal isentropic isentrop isentropisch calc ber berechnet model sim est std stdev sigma dev min max raw roh 计算"),
    (&[Command], "set soll sollwert setpoint sp cmd command demand target vorgabe consigne consigna задан 设定 设定值 给定 目标"),
    (&[Engine, Other], "engine eng motor moteur motore erpm двигател 发动机"),
    (&[Manifold], "manifold collecteur kruemmer"),
    (&[Other], "fuel kraftstoff carburant gasoil gasoel egr agr kuehl kuehlwasser wasser water coolant cool cooling eau agua acqua crank crankcase saugrohr cylinder zylinder burner brenner orifice blende venturi bypass leak leakage torque drehmoment dyno dpf scr doc топлив охлажда 燃油 冷却水 水 孔板"),
    (&[Cooler, Other], "cooler intercooler aftercooler ladeluftkuehler kuehler cac llk 中冷"),
    // Differences, limits and uncertainties.
    (&[Other], "dp dt delta diff difference differenz differenzdruck drop loss verlust druckverlust druckabfall perte chute caida ecart rise perepad перепад разност 压差 温差 温升 差 limit limits alarm trip warn warning grenze grenzwert limite uncertainty unsicherheit incertitude error fehler tolerance 报警 极限 不确定度"),
    (&[Is(Pressure), Back], "backpressure"),
    (&[Back], "back"),
    (&[Filler], "dot of the der dem du de la le des del do da della di at rate parameter mean avg measured на в"),
];

static WORDS: LazyLock<HashMap<&str, &[Word]>> = LazyLock::new(|| {
    TABLE.iter().flat_map(|(means, words)| words.split(' ').map(move |word| (word, *means))).collect()
});

/// The meanings of a word in lower case without accents.
pub(crate) fn meanings(word: &str) -> Option<&'static [Word]> {
    WORDS.get(word).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_has_one_row() {
        assert_eq!(TABLE.iter().map(|(_, words)| words.split(' ').count()).sum::<usize>(), WORDS.len());
    }
}
