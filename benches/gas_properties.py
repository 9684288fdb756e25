"""Heat capacities of the species of `gas:` and second virial coefficients of water vapour, as polynomials, and how far they are from CoolProp's.

    pip install CoolProp numpy
    python benches/gas_properties.py

Prints the constants of crates/physics/src/gas/mixture.rs: `cp/R` of the ideal gas in powers of T/1000 K, least squares of the relative
error at 400 temperatures from 220 to 1400 K, four times the weight below 650 K, where compressors work. Then those of
crates/physics/src/gas/mixture.rs: second virial coefficients in powers of 1/T, of water vapour (IAPWS-95, relative error) and of water vapour with air
(Harvey and Huang, Int. J. Thermophys. 28, 2007, as in ASHRAE RP-1485).
"""

import CoolProp.CoolProp as coolprop
import numpy as np
from CoolProp.HumidAirProp import HAProps_Aux

SPECIES = {"N2": "Nitrogen", "O2": "Oxygen", "Ar": "Argon", "CO2": "CarbonDioxide", "H2O": "Water", "H2": "Hydrogen", "CH4": "Methane"}
GAS_CONSTANT = 8.314462618
TEMPERATURES_K = np.linspace(220, 1400, 400)
DEGREE = 6


def heat_capacity_ratios(fluid):
    state = coolprop.AbstractState("HEOS", fluid)
    state.specify_phase(coolprop.iphase_gas)
    ratios = []
    for temperature_k in TEMPERATURES_K:
        state.update(coolprop.DmolarT_INPUTS, 1e-6, temperature_k)
        ratios.append(state.cp0molar() / GAS_CONSTANT)
    return np.array(ratios)


for symbol, fluid in SPECIES.items():
    exact = heat_capacity_ratios(fluid)
    weights = np.where(TEMPERATURES_K < 650, 4, 1) / exact
    fit = np.polynomial.polynomial.polyfit(TEMPERATURES_K / 1000, exact, DEGREE, w=weights)
    error = np.polynomial.polynomial.polyval(TEMPERATURES_K / 1000, fit) / exact - 1
    below = TEMPERATURES_K < 650
    print(symbol, [float(f"{c:.8g}") for c in fit])
    print(f"   {100 * abs(error[below]).max():.3f} % below 650 K, {100 * abs(error).max():.3f} % in all")
    constants = [coolprop.PropsSI(key, fluid) for key in ("M", "Tcrit", "pcrit", "rhomolar_critical", "acentric")]
    print("   molar mass kg/mol, critical K, Pa, mol/m3, acentric factor:", [float(f"{value:.7g}") for value in constants])


def virial_of_water(temperature_k):
    state = coolprop.AbstractState("HEOS", "Water")
    state.specify_phase(coolprop.iphase_gas)
    state.update(coolprop.DmolarT_INPUTS, 1e-6, temperature_k)
    return state.Bvirial()


def virial_with_air(temperature_k):
    return HAProps_Aux("Baw", temperature_k, 101.325, 0.01)[0]


VIRIAL_EXPONENTS = [0, 1, 2, 3, 8]
for name, virial, lowest_k, relative in [("water", virial_of_water, 280, True), ("water and air", virial_with_air, 250, False)]:
    temperatures_k = np.linspace(lowest_k, 1400, 600)
    exact = np.array([virial(temperature_k) for temperature_k in temperatures_k])
    # The coefficient of water changes sign at 1500 K.
    weights = 1 / (4e-5 - exact) if relative else np.ones_like(exact)
    powers = np.array([(300 / temperatures_k) ** exponent for exponent in VIRIAL_EXPONENTS]).T
    fit = np.linalg.lstsq(powers * weights[:, None], exact * weights, rcond=None)[0]
    error = powers @ fit - exact
    print(name, [float(f"{c * 300.0**exponent:.8g}") for c, exponent in zip(fit, VIRIAL_EXPONENTS)])
    print(f"   {1e6 * abs(error[temperatures_k > 290]).max():.2f} cm3/mol above 290 K, of {1e6 * exact[0]:.0f} to {1e6 * exact[-1]:.0f}")
