/* FMI 2.0 for co-simulation around the machine. Inputs are held from one communication point to the next. A shared library has
   the plain names of the standard; who links several such sources into one program defines FMI2_FUNCTION_PREFIX. */

#include "fmi2Functions.h"
#include "machine.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED, FAILED } Phase;

/* What a saved state holds. */
typedef struct {
    double real[VR_COUNT];
    int switches[SW_COUNT];
    double y[STATES];
    double time_s, step_s, tolerance;
    int stale; /* outputs do not belong to states and inputs yet */
    Phase phase;
} Machine;

typedef struct {
    Machine machine;
    fmi2CallbackFunctions callbacks;
    char *name;
    int logging;
} Instance;

static void tell(Instance *instance, fmi2Status status, const char *message) {
    if (instance->callbacks.logger != NULL && (instance->logging || status >= fmi2Warning)) {
        instance->callbacks.logger(instance->callbacks.componentEnvironment, instance->name, status,
                                   status >= fmi2Error ? "logStatusError" : "logStatusWarning", "%s", message);
    }
}

static fmi2Status fail(Instance *instance, const char *message) {
    tell(instance, fmi2Error, message);
    return fmi2Error;
}

static void begin(Machine *machine) {
    memset(machine, 0, sizeof *machine);
    memcpy(machine->real, real_start, sizeof real_start);
    memcpy(machine->switches, switch_start, sizeof switch_start);
    machine->tolerance = DEFAULT_TOLERANCE;
    machine->stale = 1;
    machine->phase = INSTANTIATED;
}

/* States from the start values, or from the inputs that drive them. */
static void take_start(Machine *machine) {
    const double *r = machine->real;
    machine->y[SPEED] = r[VR_start_N] * PI / 30.0;
    machine->y[OUTLET] = r[VR_start_P2];
    machine->y[COMPRESSOR_HOUSING] = r[VR_start_Tc];
    machine->y[TURBINE_HOUSING] = r[VR_start_Tt];
    machine->y[INNER_WALL] = r[VR_start_T_inner];
    machine->y[PROBE_TIP] = r[VR_start_Tc];
    machine->step_s = 0.0;
    machine->stale = 1;
}

static void take_driven(Machine *machine) {
    if (machine->switches[SW_driven]) {
        machine->y[SPEED] = machine->real[VR_N_set] * PI / 30.0;
        machine->y[OUTLET] = machine->real[VR_P2_set];
    }
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)n, (void)categories;
    ((Instance *)c)->logging = on;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Instance *instance;
    (void)resources, (void)visible;
    if (callbacks == NULL || callbacks->allocateMemory == NULL || callbacks->freeMemory == NULL || name == NULL || guid == NULL) {
        return NULL;
    }
    instance = callbacks->allocateMemory(1, sizeof *instance);
    if (instance == NULL) {
        return NULL;
    }
    instance->callbacks = *callbacks;
    instance->logging = logging;
    instance->name = callbacks->allocateMemory(strlen(name) + 1, 1);
    if (instance->name == NULL) {
        callbacks->freeMemory(instance);
        return NULL;
    }
    memcpy(instance->name, name, strlen(name) + 1);
    begin(&instance->machine);
    if (type != fmi2CoSimulation || strcmp(guid, MODEL_GUID) != 0) {
        tell(instance, fmi2Error, type != fmi2CoSimulation ? "this FMU is for co-simulation alone"
                                                           : "the GUID is not that of this FMU: modelDescription.xml and library do not belong together");
        fmi2FreeInstance(instance);
        return NULL;
    }
    return instance;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *instance = c;
    if (instance != NULL) {
        const fmi2CallbackFunctions callbacks = instance->callbacks;
        callbacks.freeMemory(instance->name);
        callbacks.freeMemory(instance);
    }
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_s,
                               fmi2Boolean stop_defined, fmi2Real stop_s) {
    Machine *machine = &((Instance *)c)->machine;
    (void)stop_defined, (void)stop_s;
    if (tolerance_defined) {
        if (!(tolerance > 0.0)) {
            return fail(c, "the tolerance must be above 0");
        }
        machine->tolerance = fmin(fmax(tolerance, 1e-11), 1e-3);
    }
    machine->time_s = start_s;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Machine *machine = &((Instance *)c)->machine;
    if (machine->phase != INSTANTIATED) {
        return fail(c, "initialization begins once, after instantiation or reset");
    }
    machine->phase = INITIALIZING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Machine *machine = &((Instance *)c)->machine;
    const char *why = machine_refuses(machine->real, machine->switches);
    if (why != NULL) {
        machine->phase = FAILED;
        return fail(c, why);
    }
    take_start(machine);
    take_driven(machine);
    if (!(machine->y[SPEED] > 0.0 && machine->y[OUTLET] > 0.0)) {
        machine->phase = FAILED;
        return fail(c, "start.N and start.P2 must be above 0");
    }
    /* The probe begins at rest with what it is in. */
    machine->y[PROBE_TIP] = probe_target_k(machine->real, machine->switches, machine->y);
    machine->phase = STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    ((Instance *)c)->machine.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    begin(&((Instance *)c)->machine);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Machine *machine = &((Instance *)c)->machine;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= VR_COUNT) {
            return fail(c, "no real variable has this value reference");
        }
        if (vr[i] >= VR_FIRST_OUTPUT && machine->stale) {
            const char *why = machine_refuses(machine->real, machine->switches);
            if (why != NULL) {
                return fail(c, why);
            }
            if (machine->phase <= INITIALIZING) {
                take_start(machine);
            }
            take_driven(machine);
            if (machine->phase <= INITIALIZING) {
                machine->y[PROBE_TIP] = probe_target_k(machine->real, machine->switches, machine->y);
            }
            machine_at(machine->real, machine->switches, machine->y, NULL);
            machine->stale = 0;
        }
        value[i] = machine->real[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Machine *machine = &((Instance *)c)->machine;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= VR_FIRST_OUTPUT) {
            return fail(c, "an output cannot be set");
        }
        if (vr[i] < VR_FIRST_INPUT && machine->phase > INITIALIZING) {
            return fail(c, "a parameter is fixed once the simulation runs");
        }
        if (!isfinite(value[i])) {
            return fail(c, "a value that is set must be finite");
        }
        if (machine->real[vr[i]] != value[i]) {
            machine->real[vr[i]] = value[i];
            machine->stale = 1;
            /* A jump of an input: the length of the step is found anew. */
            machine->step_s = 0.0;
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= SW_COUNT) {
            return fail(c, "no boolean variable has this value reference");
        }
        value[i] = ((Instance *)c)->machine.switches[vr[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    Machine *machine = &((Instance *)c)->machine;
    size_t i;
    for (i = 0; i < n; i++) {
        if (vr[i] >= SW_COUNT || machine->phase > INITIALIZING) {
            return fail(c, "a boolean parameter is set before the simulation runs");
        }
        machine->switches[vr[i]] = value[i] ? 1 : 0;
        machine->stale = 1;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at_s, fmi2Real span_s, fmi2Boolean no_return) {
    Machine *machine = &((Instance *)c)->machine;
    const char *why = machine_refuses(machine->real, machine->switches);
    (void)no_return;
    if (machine->phase != STEPPING) {
        return fail(c, "a step needs an initialized machine");
    }
    if (why != NULL) {
        return fail(c, why);
    }
    if (!(span_s >= 0.0) || !isfinite(span_s)) {
        return fail(c, "the length of a step must be finite and not negative");
    }
    take_driven(machine);
    if (integrate(machine->real, machine->switches, machine->y, span_s, machine->tolerance, &machine->step_s) != 0) {
        machine->phase = FAILED;
        return fail(c, "no step of sensible length meets the tolerance: inputs or parameters are beyond the model");
    }
    machine->time_s = at_s + span_s;
    machine_at(machine->real, machine->switches, machine->y, NULL);
    machine->stale = 0;
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *instance = c;
    if (*state == NULL) {
        *state = instance->callbacks.allocateMemory(1, sizeof(Machine));
        if (*state == NULL) {
            return fail(c, "no memory for a state");
        }
    }
    memcpy(*state, &instance->machine, sizeof(Machine));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    if (state == NULL) {
        return fail(c, "no state to go back to");
    }
    memcpy(&((Instance *)c)->machine, state, sizeof(Machine));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (state != NULL && *state != NULL) {
        ((Instance *)c)->callbacks.freeMemory(*state);
        *state = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = ((Instance *)c)->machine.time_s;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) { return fail(c, "steps are never asynchronous"); }

/* What this FMU has not. */
#define ABSENT(name, arguments) \
    fmi2Status name arguments { return fail(c, #name ": this FMU has no such thing"); }

/* The arguments of what is absent are not looked at. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* Empty lists of variables that this FMU has none of may be asked for. */
#define NONE(name, type) \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]) { \
        return n == 0 ? fmi2OK : fail(c, #name ": this FMU has no such variables"); \
    }
NONE(fmi2GetInteger, fmi2Integer)
NONE(fmi2GetString, fmi2String)
NONE(fmi2SetInteger, const fmi2Integer)
NONE(fmi2SetString, const fmi2String)
ABSENT(fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate s, size_t *n))
ABSENT(fmi2SerializeFMUstate, (fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n))
ABSENT(fmi2DeSerializeFMUstate, (fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s))
ABSENT(fmi2GetDirectionalDerivative, (fmi2Component c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[], size_t nk,
                                      const fmi2Real du[], fmi2Real dk[]))
ABSENT(fmi2SetRealInputDerivatives, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], const fmi2Real v[]))
ABSENT(fmi2GetRealOutputDerivatives, (fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer o[], fmi2Real v[]))
ABSENT(fmi2GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *v))
ABSENT(fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *v))
ABSENT(fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *v))
ABSENT(fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *v))
