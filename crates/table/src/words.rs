//! The table of the words in names of measured quantities, in all languages that the readers of logs and maps know.

use std::collections::HashMap;
use std::sync::LazyLock;

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
/// uncertainty; `Engine` always has `Other` too. `Acronym` marks abbreviations such as CIT (compressor inlet temperature).
#[allow(missing_docs, reason = "the names are words of the table")]
#[rustfmt::skip]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Word {
    Is(Measured), Ratio, Compression, Expansion,
    Compressor, Turbine, Shaft, Exhaust, Air, Charge, Oil, Housing, Bearing, Ambient, Dew, Engine, Manifold, Other,
    In, Out, Before, After, Acronym,
    Total, Static, Corrected, Computed, Command, Filler,
}

use Measured::{
    Efficiency, Flow, Humidity, Opening, Pressure, PressureRatio, Speed, Temperature, Vane, VolumeFlow,
};
use Word::{
    Acronym, After, Air, Ambient, Bearing, Before, Charge, Command, Compression, Compressor, Computed,
    Corrected, Dew, Engine, Exhaust, Expansion, Filler, Housing, In, Is, Manifold, Oil, Other, Out, Ratio,
    Shaft, Static, Total, Turbine,
};

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
    (&[Is(Pressure)], "press prs pressure druck pression presion pressione pressao druk tryck cisnienie tlak давлен 压力 气压 压 圧力 圧"),
    (&[Is(Pressure), Total], "pt"),
    (&[Is(Pressure), Static], "ps"),
    (&[Is(Pressure), Charge], "ladedruck"),
    (&[Is(Pressure), Ambient], "luftdruck baro pbar barometer barometric barometrisch barometerdruck барометр барометрическ 大气压 大气压力 大気圧"),
    (&[Is(Speed)], "speed spd drehzahl rpm vitesse regime velocidad velocita giri rotacao toerental varvtal rotation rotations rotational umdrehungen predkosc obroty otacky оборот вращен 转速 回転数 回転速度"),
    (&[Is(Speed), Corrected], "nc"),
    (&[Is(Flow)], "flow massflow mass massflowrate massrate massenstrom massenfluss durchsatz massendurchsatz debit caudal portata vazao gasto massastroom floede fm masy strumien przeplyw prutok mdot dm mf расход 流量 质量流量 質量流量"),
    (&[Is(Flow), Compressor], "mc wc mv ml ma wa massc"),
    (&[Is(Flow), Turbine], "mt wt"),
    (&[Is(Flow), Air], "maf caf luftmasse"),
    (&[Is(VolumeFlow)], "volume volumen volumetric volumique volumica volumetrico volumetrica volumenstrom volflow vdot volumenfluss объем 体积流量 体积 容积流量"),
    (&[Is(PressureRatio)], "pr prss pi pik π druckverh druckverhaeltnis ladedruckverhaeltnis sprez 压比 增压比 压力比 压缩比 圧力比"),
    (&[Is(PressureRatio), Expansion], "er 膨胀比 落压比"),
    (&[Is(Efficiency)], "eta η eff effic efficiency wirkungsgrad rendement rendimiento rendimento eficiencia efficienza sprawnosc ucinnost кпд 效率 効率"),
    (&[Is(Humidity)], "rh humidity humid relhum feuchte luftfeuchte humedad umidita humidite humidade wilgotnosc влажност 湿度"),
    (&[Is(Temperature), Dew], "dew dewpoint taupunkt rosee rocio rugiada orvalho rosy росы 露点"),
    (&[Is(Opening)], "valve ventil klappe drossel drosselklappe bpv back backpressure opening oeffnung vanne valvola valvula клапан 阀门 阀 开度 背压阀"),
    (&[Is(Vane)], "vane vanes vgt vtg vnt rack nozzle leitschaufel leitapparat wastegate 导叶"),
    (&[Ratio], "ratio verhaeltnis rapport taux relacion rapporto razao verhouding отношени степен"),
    (&[Compression], "compression compressione compresion kompression"),
    (&[Expansion], "expansion detente espansione entspannung"),
    (&[Compressor], "comp compr cmp cmpr compressor verd verdichter kompressor kompresor sprezarka sprezarki lader compresseur compresor compressore компрессор 压气机 压缩机 压气 圧縮機 コンプレッサ"),
    (&[Turbine], "tur turb turbine turbinen turbina turbiny turbin турбин 涡轮 涡轮机 透平 タービン"),
    (&[Shaft], "tc tl atl turbo turbocharger turbolader abgasturbolader turbocompressore shaft rotor spool gg laeufer welle arbre eje ротор турбокомпрессор 涡轮增压器 增压器 转子 ターボ 過給機 ткр"),
    (&[Exhaust], "abgas exh exhaust gas hotgas echappement scarico выхлоп 排气 废气 燃气"),
    (&[Air], "air luft aire aria ar lucht powietrza powietrze воздух 空气"),
    (&[Charge], "boost ladeluft"),
    (&[Oil], "oil oel huile aceite olio oleo olej olie olje масл 机油 滑油 润滑油 潤滑油 油"),
    (&[Housing], "housing hsg casing wall skin metal wand geh gehaeuse gehause body material carter carcasa carcassa paroi pared корпус 壳体 蜗壳 外壳 壳"),
    (&[Bearing], "bearing lager lagergehaeuse palier cojinete подшипник 轴承 轴承体"),
    (&[Ambient], "amb ambient ambiant ambiante ambiente umg umgebung omgivning omgeving otoczenia otoczenie room raum cell zelle testbed pruefstand atm atmospheric atmospherique atmosphere окружающ 环境 大气 大気"),
    (&[In], "in inl inlet inlaat intake suc suct ein eintritt ansaug suction entree entry entrada entrata ingresso admission admision aspiration wlot wlotu вход входе 进口 入口 进 吸入"),
    (&[In, Air], "进气"),
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
    (&[Other], "fuel kraftstoff carburant gasoil gasoel egr agr cooler intercooler ladeluftkuehler kuehler kuehl kuehlwasser wasser water coolant cool cooling eau agua acqua crank crankcase saugrohr cylinder zylinder burner brenner orifice blende venturi bypass leak leakage torque drehmoment dyno cac llk dpf scr doc топлив охлажда 燃油 冷却水 水 中冷 孔板"),
    // Differences, limits and uncertainties.
    (&[Other], "dp dt delta diff difference differenz differenzdruck drop loss verlust druckverlust druckabfall perte chute caida ecart rise perepad перепад разност 压差 温差 温升 差 limit limits alarm trip warn warning grenze grenzwert limite uncertainty unsicherheit incertitude error fehler tolerance 报警 极限 不确定度"),
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
