/* Steps the FMU that it is compiled with and prints all its real variables, at the start and after each second. */

#include "fmi2Functions.h"
#include "model_data.h"
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...) {
    va_list arguments;
    (void)e, (void)name, (void)category;
    va_start(arguments, message);
    fprintf(stderr, "%d: ", (int)status);
    vfprintf(stderr, message, arguments);
    fprintf(stderr, "\n");
    va_end(arguments);
}

static void free_memory(void *place) { free(place); }

static void check(fmi2Status status) {
    if (status != fmi2OK) {
        exit(1);
    }
}

static void print(fmi2Component c) {
    fmi2ValueReference vr;
    for (vr = 0; vr < VR_COUNT; vr++) {
        fmi2Real value;
        check(fmi2GetReal(c, &vr, 1, &value));
        printf("%.17g ", value);
    }
    printf("\n");
}

int main(int count, char **arguments) {
    const fmi2CallbackFunctions callbacks = {logger, calloc, free_memory, NULL, NULL};
    const int seconds = count > 1 ? atoi(arguments[1]) : 0;
    int second;
    fmi2Component c = fmi2Instantiate("test", fmi2CoSimulation, MODEL_GUID, "", &callbacks, 0, 0);
    fmi2FMUstate kept = NULL;
    check(fmi2SetupExperiment(c, 1, 1e-10, 0.0, 0, 0.0));
    check(fmi2EnterInitializationMode(c));
    check(fmi2ExitInitializationMode(c));
    print(c);
    for (second = 0; second < seconds; second++) {
        /* Back to a kept state, and the same way again. */
        check(fmi2GetFMUstate(c, &kept));
        check(fmi2DoStep(c, second, 1.0, 1));
        check(fmi2SetFMUstate(c, kept));
        check(fmi2DoStep(c, second, 1.0, 1));
        print(c);
    }
    check(fmi2FreeFMUstate(c, &kept));
    check(fmi2Terminate(c));
    fmi2FreeInstance(c);
    return 0;
}
