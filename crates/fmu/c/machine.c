/* The lumped turbocharger: shaft, outlet volume, two housings and the gas paths between them (Burke et al., eqs. 1-12 and
   Appendix A). The same equations, in the same order, as the program's own model. */

#include "machine.h"
#include <math.h>
#include <stddef.h>

/* Flow below which the gas path is not evaluated (it divides by the flow), kg/s. */
#define LOWEST_FLOW_KG_S 1e-4
/* Shaft speed to which the friction heat of the bearing refers, rad/s. */
#define RAD_S_AT_100_KRPM (1e5 * PI / 30.0)

static double largest(double a, double b) { return a > b ? a : b; }

/* ---- gas ---- */

#define MOLAR_GAS_CONSTANT 8.314462618

/* Of dry air, real or of the closed form as `gas`. */
static double air_constant(const Gas *gas) { return gas->is_real ? REAL_AIR_GAS_CONSTANT : GAS_CONSTANT; }

/* `dry` with a mass fraction of water vapour. */
static Gas with_vapour(const Gas *dry, double fraction) {
    Gas gas;
    double x;
    int i;
    gas.constant = dry->constant + fraction * (VAPOUR.constant - dry->constant);
    x = fraction * VAPOUR.constant / gas.constant;
    for (i = 0; i < 7; i++) gas.cp[i] = dry->cp[i] + fraction * (VAPOUR.cp[i] - dry->cp[i]);
    for (i = 0; i < 5; i++) {
        gas.virial[i] = dry->is_real ? (1.0 - x) * ((1.0 - x) * dry->virial[i] + 2.0 * x * dry->virial_with_vapour[i])
                                           + x * x * VAPOUR.virial[i]
                                     : 0.0;
        gas.virial_with_vapour[i] = 0.0;
    }
    gas.is_real = dry->is_real;
    return gas;
}

/* At zero pressure, J/(kg K). */
static double heat_capacity(const Gas *gas, double t_k) {
    double sum = 0.0;
    int i;
    for (i = 6; i >= 0; i--) sum = sum * 1e-3 * t_k + gas->cp[i];
    return sum;
}

/* The term of the second virial coefficient in x^8, over x^3, with x = 1/T. */
static double steep_term(const Gas *gas, double x) { return gas->virial[4] * x * (x * x) * (x * x); }

/* What a pressure adds to the enthalpy in J/kg, the entropy and the heat capacity in J/(kg K) of a perfect gas. */
static double enthalpy_departure(const Gas *gas, double t_k, double p_pa) {
    const double *b = gas->virial, x = 1.0 / t_k;
    return p_pa * gas->constant / MOLAR_GAS_CONSTANT
           * (b[0] + x * (2.0 * b[1] + x * (3.0 * b[2] + x * (4.0 * b[3] + 9.0 * steep_term(gas, x)))));
}

static double entropy_departure(const Gas *gas, double t_k, double p_pa) {
    const double *b = gas->virial, x = 1.0 / t_k;
    return p_pa * gas->constant / MOLAR_GAS_CONSTANT * x * x
           * (b[1] + x * (2.0 * b[2] + x * (3.0 * b[3] + 8.0 * steep_term(gas, x))));
}

static double heat_capacity_departure(const Gas *gas, double t_k, double p_pa) {
    const double *b = gas->virial, x = 1.0 / t_k;
    return -p_pa * gas->constant / MOLAR_GAS_CONSTANT * x * x
           * (2.0 * b[1] + x * (6.0 * b[2] + x * (12.0 * b[3] + 72.0 * steep_term(gas, x))));
}

/* Specific enthalpy, J/kg. */
static double enthalpy(const Gas *gas, double t_k, double p_pa) {
    double sum = 0.0;
    int i;
    for (i = 6; i >= 0; i--) sum = sum * 1e-3 * t_k + gas->cp[i] / (i + 1);
    return sum * t_k + enthalpy_departure(gas, t_k, p_pa);
}

/* int cp/T dT without its first term, J/(kg K). */
static double entropy_terms(const Gas *gas, double t_k) {
    double sum = 0.0;
    int i;
    for (i = 6; i >= 1; i--) sum = (sum + gas->cp[i] / i) * 1e-3 * t_k;
    return sum;
}

/* After a rise of the enthalpy by `rise` J/kg between two pressures, K: Newton's method. */
static double heated_k(const Gas *gas, double from_k, double from_pa, double to_pa, double rise) {
    const double to_j_kg = enthalpy(gas, from_k, from_pa) + rise;
    double to_k = from_k + rise / heat_capacity(gas, from_k);
    int i;
    for (i = 0; i < 2; i++)
        to_k += (to_j_kg - enthalpy(gas, to_k, to_pa)) / (heat_capacity(gas, to_k) + heat_capacity_departure(gas, to_k, to_pa));
    return to_k;
}

/* After isentropic compression, K. */
static double isentropic_k(const Gas *gas, double from_k, double from_pa, double to_pa) {
    const double fall = gas->constant * log(to_pa / from_pa);
    double ln_ratio = fall / heat_capacity(gas, from_k), to_k = from_k * exp(ln_ratio);
    int i;
    for (i = 0; i < 2; i++) {
        const double entropy = gas->cp[0] * ln_ratio + entropy_terms(gas, to_k) - entropy_terms(gas, from_k)
                               + entropy_departure(gas, to_k, to_pa) - entropy_departure(gas, from_k, from_pa);
        const double step = (fall - entropy) / (heat_capacity(gas, to_k) + heat_capacity_departure(gas, to_k, to_pa));
        ln_ratio += step;
        to_k *= 1.0 + step * (1.0 + step * (0.5 + step / 6.0));
    }
    return to_k;
}

/* ---- convection, by the properties of dry air ---- */

static double air_heat_capacity(double t_k) { return 1002.5 + 275e-6 * (t_k - 200.0) * (t_k - 200.0); }
static double viscosity(double t_k) { return 1.458e-6 * t_k * sqrt(t_k) / (t_k + 110.4); }
static double conductivity(double t_k) { return 0.02624 * pow(t_k / 300.0, 0.8646); }

/* Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14, as a coefficient in W/(m2 K). */
static double convection(double a, double b, double diameter_m, double flow_kg_s, double bulk_k, double wall_k) {
    const double mu = viscosity(bulk_k), k = conductivity(bulk_k);
    const double reynolds = 4.0 * flow_kg_s / (PI * diameter_m * mu);
    const double prandtl = air_heat_capacity(bulk_k) * mu / k;
    const double nusselt = a * exp(b * log(reynolds) + log(prandtl) / 3.0 + WALL_EXPONENT * log(mu / viscosity(wall_k)));
    return nusselt * k / diameter_m;
}

/* ---- metal ---- */

static double external_heat(double area_m2, double emissivity, double convection_ratio, double wall_k, double ambient_k) {
    const double over_k = wall_k - ambient_k;
    return area_m2 * (convection_ratio * 1.25 * cbrt(fabs(over_k)) * over_k
                      + emissivity * STEFAN_BOLTZMANN * (pow(wall_k, 4) - pow(ambient_k, 4)));
}

/* ---- back-pressure valve ---- */

static double orifice(double area_m2, double p_up_pa, double t_up_k, double p_down_pa) {
    const double g = GAMMA_AIR, critical = pow(2.0 / (g + 1.0), g / (g - 1.0));
    double r, r_kappa, r_2_g;
    if (p_up_pa <= p_down_pa) {
        return 0.0;
    }
    r = largest(p_down_pa / p_up_pa, critical);
    r_kappa = pow(r, (g - 1.0) / g);
    r_2_g = (r / r_kappa) * (r / r_kappa);
    return area_m2 * p_up_pa / sqrt(GAS_CONSTANT * t_up_k) * sqrt(2.0 * g / (g - 1.0) * r_2_g * (1.0 - r_kappa));
}

/* ---- turbine ---- */

static double drop_ratio(double ln_expansion, double cp) { return 1.0 - exp(-TURBINE_GAS.constant / cp * ln_expansion); }

static void turbine(double *r, double housing_k, double speed_rad_s) {
    const double t3_k = r[VR_T3], ln_expansion = log(r[VR_P3] / r[VR_P4]);
    const double flow = r[VR_turbine_choked_flow] * sqrt(1.0 - exp(-1.1 * ln_expansion)) * (r[VR_P3] / 101325.0) / sqrt(t3_k / 288.15)
                        / sqrt(TURBINE_GAS.constant / air_constant(&TURBINE_GAS));
    const double cp = heat_capacity(&TURBINE_GAS, t3_k);
    const double h = convection(r[VR_turbine_nusselt_coefficient], r[VR_turbine_nusselt_exponent], r[VR_turbine_inlet_diameter], flow,
                                t3_k, housing_k);
    const double conductance = h * r[VR_turbine_internal_area], units = conductance / (flow * cp);
    const double before_k = (t3_k + units * housing_k) / (1.0 + units);
    const double cp_before = heat_capacity(&TURBINE_GAS, before_k);
    const double spouting = sqrt(2.0 * cp_before * before_k * drop_ratio(ln_expansion, cp_before));
    const double best = r[VR_turbine_peak_blade_speed_ratio];
    const double away = (speed_rad_s * r[VR_turbine_wheel_radius] / spouting - best) / best;
    const double efficiency = largest(r[VR_turbine_peak_efficiency] * (1.0 - 0.8 * away * away), 0.05);
    const double drop_k = efficiency * before_k * drop_ratio(ln_expansion, cp);
    r[VR_m_t] = flow;
    r[VR_T4] = before_k - drop_k;
    r[VR_W_t] = flow * cp * drop_k;
    r[VR_q_t] = conductance * (before_k - housing_k);
    r[VR_eta_t] = efficiency;
}

/* ---- the T2 probe ---- */

static double probe_time_constant(double tip_m, double pipe_m, double flow_kg_s, double t2_k) {
    const double mu = viscosity(t2_k), k = conductivity(t2_k), prandtl = air_heat_capacity(t2_k) * mu / k;
    const double reynolds = 4.0 * flow_kg_s * tip_m / (PI * pipe_m * pipe_m * mu), root = cbrt(reynolds);
    const double nusselt = 2.0 + (0.4 * sqrt(reynolds) + 0.06 * root * root) * pow(prandtl, 0.4);
    return 8600.0 * 480.0 * tip_m * tip_m / (6.0 * nusselt * k);
}

/* ---- everything ---- */

/* Writes the outputs; returns the probe's target, K. */
static double outputs(double *r, const int *switches, const double *y, double *valve_kg_s, double *inner_heat_w) {
    const double t1_k = r[VR_T1], p1_pa = r[VR_P1];
    const double humidity = r[VR_compressor_humidity];
    const Gas gas = with_vapour(&COMPRESSOR_GAS, humidity / (1.0 + humidity));
    const double flow_ratio = sqrt(air_constant(&gas) / gas.constant);
    const double cp1 = heat_capacity(&gas, t1_k);
    const double p2_pa = y[OUTLET], pressure_ratio = p2_pa / p1_pa;
    const int inner = r[VR_compressor_inner_capacity_ratio] > 0.0;
    const double wall_k = inner ? y[INNER_WALL] : y[COMPRESSOR_HOUSING];
    const double speed_rpm = y[SPEED] * 30.0 / PI;
    const double gamma = r[VR_compressor_efficiency_gamma];
    const int by_enthalpy = switches[SW_compressor_efficiency_by_enthalpy] && gamma <= 0.0;
    const double rise = by_enthalpy
                        ? (enthalpy(&gas, isentropic_k(&gas, t1_k, p1_pa, p2_pa), p2_pa) - enthalpy(&gas, t1_k, p1_pa)) / (cp1 * t1_k)
                        : pow(pressure_ratio, gamma > 0.0 ? (gamma - 1.0) / gamma : gas.constant / cp1) - 1.0;
    const double circle = r[VR_compressor_recirculation_ratio];
    const double pipe_m = r[VR_compressor_outlet_diameter];
    MapPoint point = map_at(r[VR_compressor_wheel_diameter], speed_rpm * sqrt(MAP_T_REF_K / t1_k), pressure_ratio,
                            r[VR_compressor_flow_scale]);
    const double flow = largest(point.flow_kg_s * (p1_pa / MAP_P_REF_PA) / sqrt(t1_k / MAP_T_REF_K) * flow_ratio / (1.0 + circle),
                                LOWEST_FLOW_KG_S);
    const double efficiency = point.efficiency * r[VR_compressor_efficiency_scale];
    const double warm_k = t1_k * (1.0 + rise / efficiency);
    const double bulk_k = by_enthalpy ? heated_k(&gas, t1_k, p1_pa, p2_pa, cp1 * (warm_k - t1_k)) : warm_k;
    const double h = convection(r[VR_compressor_nusselt_coefficient], r[VR_compressor_nusselt_exponent], pipe_m, flow, bulk_k, wall_k)
                     * cbrt(cp1 / air_heat_capacity(t1_k));
    const double conductance = h * r[VR_compressor_internal_area], alpha = r[VR_compressor_alpha_area];
    double before_w_k, after_w_k, q1_w, units, target_k, equivalent_k;

    before_w_k = conductance * (wall_k > t1_k ? r[VR_compressor_hot_metal_h_ratio] : 1.0) * r[VR_compressor_inlet_h_ratio];
    if (switches[SW_compressor_own_inlet_convection]) {
        const double b = r[VR_compressor_nusselt_exponent];
        before_w_k *= convection(1.0, b, r[VR_compressor_inlet_diameter], 1.0, t1_k, t1_k)
                      / convection(1.0, b, pipe_m, 1.0, bulk_k, t1_k);
    }
    before_w_k = before_w_k * alpha + r[VR_compressor_inlet_conductance];
    q1_w = before_w_k * (t1_k - wall_k);
    r[VR_T1_prime] = t1_k - q1_w / (flow * cp1);
    equivalent_k = r[VR_T1_prime] * (1.0 + rise / efficiency) / largest(1.0 - circle * rise / efficiency, 0.1);
    r[VR_T2_prime] = by_enthalpy ? heated_k(&gas, r[VR_T1_prime], p1_pa, p2_pa, cp1 * (equivalent_k - r[VR_T1_prime]))
                                 : equivalent_k;
    after_w_k = conductance * (wall_k > r[VR_T2_prime] ? r[VR_compressor_hot_metal_h_ratio] : 1.0) * (1.0 - alpha);
    units = after_w_k / (flow * heat_capacity(&gas, bulk_k));
    r[VR_T2] = (r[VR_T2_prime] + units * wall_k) / (1.0 + units);

    r[VR_N] = speed_rpm;
    r[VR_P2] = y[OUTLET];
    r[VR_Tc] = y[COMPRESSOR_HOUSING];
    r[VR_Tt] = y[TURBINE_HOUSING];
    r[VR_T_inner] = wall_k;
    r[VR_m_c] = flow;
    r[VR_m_corrected] = point.flow_kg_s;
    r[VR_pressure_ratio] = pressure_ratio;
    r[VR_surge_position] = point.surge_position;
    r[VR_eta] = efficiency;
    r[VR_h] = h;
    r[VR_q_c] = q1_w + after_w_k * (r[VR_T2] - wall_k);
    r[VR_W_c] = gamma > 0.0 ? flow * (enthalpy(&gas, equivalent_k, p2_pa) - enthalpy(&gas, r[VR_T1_prime], p1_pa))
                            : flow * cp1 * (equivalent_k - r[VR_T1_prime]);
    turbine(r, y[TURBINE_HOUSING], y[SPEED]);

    target_k = r[VR_T2] + r[VR_probe_stem_ratio] * (y[COMPRESSOR_HOUSING] - r[VR_T2]);
    if (r[VR_probe_recovery_ratio] != 1.0) {
        const double velocity = flow * gas.constant * r[VR_T2] / (y[OUTLET] * 0.25 * PI * pipe_m * pipe_m);
        target_k -= (1.0 - r[VR_probe_recovery_ratio]) * 0.5 * velocity * velocity / air_heat_capacity(r[VR_T2]);
    }
    r[VR_T2_probe] = r[VR_probe_diameter] > 0.0 ? y[PROBE_TIP] : target_k;
    *valve_kg_s = flow_ratio * orifice(r[VR_valve] * r[VR_outlet_discharge_coefficient] * r[VR_outlet_valve_area], y[OUTLET],
                                       r[VR_T2], p1_pa);
    *inner_heat_w = inner ? r[VR_compressor_inner_conductance] * (wall_k - y[COMPRESSOR_HOUSING]) : 0.0;
    return target_k;
}

double probe_target_k(double *r, const int *switches, const double *y) {
    double valve_kg_s, inner_heat_w;
    return outputs(r, switches, y, &valve_kg_s, &inner_heat_w);
}

void machine_at(double *r, const int *switches, const double *y, double *rates) {
    const double humidity = r[VR_compressor_humidity], vapour = humidity / (1.0 + humidity);
    const double gas_constant = COMPRESSOR_GAS.constant + vapour * (VAPOUR.constant - COMPRESSOR_GAS.constant);
    const double phi = r[VR_compressor_inner_capacity_ratio];
    const double tc_k = y[COMPRESSOR_HOUSING], tt_k = y[TURBINE_HOUSING];
    const double to_bearing = 2.0 * r[VR_bearing_conductivity] * r[VR_bearing_section_area] / r[VR_bearing_length];
    const double to_oil = r[VR_bearing_oil_conductance];
    const double friction = r[VR_bearing_friction_heat] * pow(y[SPEED] / RAD_S_AT_100_KRPM, 2);
    const double bearing_k =
        (to_bearing * (tt_k + tc_k) + to_oil * r[VR_T_oil] + friction) / (2.0 * to_bearing + to_oil);
    double valve_kg_s, inner_heat_w, target_k, radiation_w, balance_w, capacity;
    target_k = outputs(r, switches, y, &valve_kg_s, &inner_heat_w);
    r[VR_m_valve] = valve_kg_s;
    r[VR_T_bearing] = bearing_k;
    if (rates == NULL) {
        return;
    }
    radiation_w = r[VR_radiation_area] * STEFAN_BOLTZMANN * (pow(tt_k, 4) - pow(tc_k, 4));
    rates[SPEED] = switches[SW_driven] ? 0.0
                                       : (r[VR_W_t] - r[VR_W_c] - r[VR_bearing_friction] * y[SPEED] * y[SPEED])
                                             / (r[VR_shaft_inertia] * y[SPEED]);
    rates[OUTLET] = switches[SW_driven] ? 0.0
                                        : GAMMA_AIR * gas_constant * r[VR_T2] / r[VR_outlet_volume]
                                              * (r[VR_m_c] - valve_kg_s);
    balance_w = (phi > 0.0 ? inner_heat_w : r[VR_q_c]) + to_bearing * (bearing_k - tc_k) + radiation_w
                - external_heat(r[VR_compressor_external_area], r[VR_compressor_emissivity], r[VR_external_convection_ratio], tc_k,
                                r[VR_T_amb]);
    capacity = r[VR_compressor_housing_mass] * (930.0 + 60.0 * (tc_k - 300.0) / 200.0);
    rates[COMPRESSOR_HOUSING] = balance_w / ((1.0 - phi) * capacity);
    balance_w = r[VR_q_t] - to_bearing * (tt_k - bearing_k) - radiation_w
                - external_heat(r[VR_turbine_external_area], r[VR_turbine_emissivity], r[VR_external_convection_ratio], tt_k,
                                r[VR_T_amb]);
    rates[TURBINE_HOUSING] = balance_w / (r[VR_turbine_housing_mass] * (500.0 + 200.0 * (tt_k - 300.0) / 500.0));
    rates[PROBE_TIP] = 0.0;
    if (r[VR_probe_diameter] > 0.0) {
        rates[PROBE_TIP] = (target_k - y[PROBE_TIP])
                           / probe_time_constant(r[VR_probe_diameter], r[VR_compressor_outlet_diameter], r[VR_m_c], r[VR_T2]);
    }
    rates[INNER_WALL] = 0.0;
    if (phi > 0.0) {
        capacity = r[VR_compressor_housing_mass] * (930.0 + 60.0 * (y[INNER_WALL] - 300.0) / 200.0);
        rates[INNER_WALL] = (r[VR_q_c] - inner_heat_w) / (phi * capacity);
    }
}

static int positive(double value) { return isfinite(value) && value > 0.0; }

const char *machine_refuses(const double *r, const int *switches) {
    if (!positive(r[VR_T1]) || !positive(r[VR_T3]) || !positive(r[VR_T_oil]) || !positive(r[VR_T_amb])) {
        return "T1, T3, T_oil and T_amb must be finite and above 0 K";
    }
    if (!positive(r[VR_P1]) || !positive(r[VR_P3]) || !positive(r[VR_P4])) {
        return "P1, P3 and P4 must be finite and above 0 Pa";
    }
    if (r[VR_P3] <= r[VR_P4]) {
        return "P3 must be above P4: the model needs flow through the turbine";
    }
    if (switches[SW_driven]) {
        if (!positive(r[VR_N_set]) || !positive(r[VR_P2_set])) {
            return "driven: N_set and P2_set must be finite and above 0";
        }
    } else if (!positive(r[VR_valve])) {
        return "valve must be finite and above 0";
    }
    return NULL;
}
