//! Machine quantities at one instant that terms can use.

use mapper_physics::machine::hooks::Site;

/// Declares the quantities: variant, name in scripts, words, value.
macro_rules! quantities {
    ($($name:ident $script:literal $words:literal $read:expr;)*) => {
        /// A machine quantity at one instant, SI.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Quantity {
            $(#[doc = $words] $name,)*
        }

        impl Quantity {
            /// Its name in an effect's script, after `at.`.
            pub fn script_name(self) -> &'static str {
                match self { $(Quantity::$name => $script,)* }
            }

            /// Description for sentences.
            pub fn words(self) -> &'static str {
                match self { $(Quantity::$name => $words,)* }
            }

            /// Its value; NaN if it is downstream of the calling hook in the gas path.
            pub fn of(self, site: &Site<'_>) -> f64 {
                let read: fn(&Site<'_>) -> f64 = match self { $(Quantity::$name => $read,)* };
                read(site)
            }
        }
    };
}

quantities! {
    Speed "speed_rad_s" "the speed" |site| site.state.shaft_speed_rad_s;
    P1 "p1_pa" "P1" |site| site.boundary.p1_pa;
    P2 "p2_pa" "P2" |site| site.state.p2_pa;
    P3 "p3_pa" "P3" |site| site.boundary.p3_pa;
    P4 "p4_pa" "P4" |site| site.boundary.p4_pa;
    T1 "t1_k" "the gas at the compressor inlet" |site| site.boundary.t1_k;
    T2Prime "t2_prime_k" "the gas behind the wheel" |site| site.t2_prime_k;
    T2 "t2_k" "the gas at the compressor outlet" |site| site.t2_k;
    T3 "t3_k" "the gas at the turbine inlet" |site| site.boundary.t3_k;
    Tc "tc_k" "the compressor housing" |site| site.state.tc_k;
    Tt "tt_k" "the turbine housing" |site| site.state.tt_k;
    Bearing "bearing_k" "the bearing housing" |site| site.bearing_k;
    Oil "oil_k" "the oil" |site| site.boundary.oil_temperature_k;
    Ambient "ambient_k" "the cell" |site| site.boundary.ambient_temperature_k;
    Flow "flow_kg_s" "the compressor's flow" |site| site.flow_kg_s;
    PressureRatio "pressure_ratio" "the pressure ratio" |site| site.pressure_ratio;
}
