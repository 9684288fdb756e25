"""Compresses gases with CoolProp at an efficiency of 0.7: a list of states in JSON, for tests/tests/all/gases.rs."""

import json

import CoolProp.CoolProp as coolprop

NAMES = {"N2": "Nitrogen", "O2": "Oxygen", "Ar": "Argon", "CO2": "CarbonDioxide", "H2O": "Water", "H2": "Hydrogen"}
AIR = {"N2": 0.78084, "O2": 0.20939, "Ar": 0.00934, "CO2": 0.00043}
MOLAR_MASS = {symbol: coolprop.PropsSI("M", name) for symbol, name in NAMES.items()}
EFFICIENCY = 0.7
INLET_PA = 100e3


class MoistAir:
    """ASHRAE RP-1485. The mixture model of the other gases has 112 cm3/mol for water with nitrogen at 335 K; this -21 (Harvey and Huang 2007)."""

    def __init__(self, water_kg_kg):
        self.water_kg_kg = water_kg_kg

    def update(self, _, pressure_pa, temperature_k):
        def per_kg(key):
            of_dry = coolprop.HAPropsSI(key, "T", temperature_k, "P", pressure_pa, "W", self.water_kg_kg)
            return of_dry / (1 + self.water_kg_kg)

        self.hmass, self.smass = lambda: per_kg("H"), lambda: per_kg("S")


def burnt(hydrogen_carbon_ratio, air_ratio):
    """Per mole of CHy with 1 + y/4 moles of oxygen needed."""
    needed = 1 + hydrogen_carbon_ratio / 4
    gas = {symbol: air_ratio * needed * x / AIR["O2"] for symbol, x in AIR.items()}
    gas["O2"] -= needed
    gas["CO2"] += 1
    return gas | {"H2O": hydrogen_carbon_ratio / 2}


def state_of(fractions):
    if isinstance(fractions, float):
        return MoistAir(fractions)
    if fractions is None:
        state = coolprop.AbstractState("HEOS", "Air")
    else:
        state = coolprop.AbstractState("HEOS", "&".join(NAMES[symbol] for symbol in fractions))
        whole = sum(fractions.values())
        state.set_mole_fractions([x / whole for x in fractions.values()])
    state.specify_phase(coolprop.iphase_gas)
    return state


def temperature(state, pressure_pa, start_k, value, target):
    """Secant method."""
    before_k, at_k = start_k, 1.01 * start_k

    def missing(temperature_k):
        state.update(coolprop.PT_INPUTS, pressure_pa, temperature_k)
        return value(state) - target

    before, at = missing(before_k), missing(at_k)
    for _ in range(50):
        if abs(at) < 1e-9 * max(1.0, abs(target)) or at == before:
            break
        before_k, at_k, before = at_k, at_k - at * (at_k - before_k) / (at - before), at
        at = missing(at_k)
    return at_k


CASES = [
    ("dry", None, [253.15, 288.15, 323.15]),
    ("moist 0.005", 0.005, [283.15, 323.15]),
    ("moist 0.02", 0.02, [300.15, 323.15]),
    ("moist 0.04", 0.04, [312.15, 323.15]),
    ("hydrogen 0.1", AIR | {"H2": 0.1}, [253.15, 288.15, 323.15]),
    ("hydrogen 0.3", AIR | {"H2": 0.3}, [253.15, 288.15, 323.15]),
    ("burnt diesel 3", burnt(1.80, 3), [323.15, 600.0]),
    # Cooler, CoolProp's coefficient of water with nitrogen is the larger error.
    ("burnt natural gas 2", burnt(3.78, 2), [400.0, 600.0]),
    ("burnt natural gas 1.2", burnt(3.78, 1.2), [500.0, 800.0]),
]

states = []
for name, fractions, temperatures_k in CASES:
    gas = state_of(fractions)
    for t1_k in temperatures_k:
        for pressure_ratio in [1.1, 2, 3, 4, 5]:
            gas.update(coolprop.PT_INPUTS, INLET_PA, t1_k)
            h1, s1 = gas.hmass(), gas.smass()
            p2_pa = pressure_ratio * INLET_PA
            isentropic_k = t1_k * pressure_ratio**0.28
            temperature(gas, p2_pa, isentropic_k, lambda state: state.smass(), s1)
            work = (gas.hmass() - h1) / EFFICIENCY
            t2_k = temperature(gas, p2_pa, isentropic_k * 1.05, lambda state: state.hmass(), h1 + work)
            states.append({"gas": name, "t1_k": t1_k, "p1_pa": INLET_PA, "p2_pa": p2_pa, "t2_k": t2_k, "work_j_kg": work})
print(json.dumps(states))
