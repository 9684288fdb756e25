"""Heat capacities of the species of `gas:`, as polynomials in the temperature, and how far they are from CoolProp's.

    pip install CoolProp numpy
    python benches/gas_properties.py

Prints the constants of crates/physics/src/gas/species.rs: `cp/R` of the ideal gas in powers of T/1000 K, least squares of the relative
error at 400 temperatures from 220 to 1400 K, four times the weight below 650 K, where compressors work.
"""

import CoolProp.CoolProp as coolprop
import numpy as np

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
