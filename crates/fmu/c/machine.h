/* The machine between the files of this FMU: what each file gives to the others. SI units, shaft speed in rad/s unless a name says rpm. */
#ifndef MACHINE_H
#define MACHINE_H

#include "model_data.h"

/* States, in this order: shaft speed rad/s, P2 Pa, compressor housing K, turbine housing K, tip of the T2 probe K, inner wall K. */
enum { SPEED, OUTLET, COMPRESSOR_HOUSING, TURBINE_HOUSING, PROBE_TIP, INNER_WALL, STATES };

/* A point of the compressor map, corrected to its reference state. */
typedef struct {
    double flow_kg_s;
    double efficiency;
    double surge_position; /* 0 or less: choked, 1: on the surge line, above: beyond it */
} MapPoint;

/* Flow and efficiency at a corrected speed (rpm) and a pressure ratio of a compressor with `flow_scale` times the flow. */
MapPoint map_at(double wheel_diameter_m, double speed_rpm, double pressure_ratio, double flow_scale);

/* Everything the machine knows: `r` holds parameters, inputs and outputs by their value references (model_data.h). Writes the
   outputs that follow from the states `y` and, where `rates` is not NULL, the states' rates. */
void machine_at(double *r, const int *switches, const double *y, double *rates);

/* Where the tip of the T2 probe tends to, K: its place at rest. */
double probe_target_k(double *r, const int *switches, const double *y);

/* Why the machine has no meaning with these inputs; NULL where it has. */
const char *machine_refuses(const double *r, const int *switches);

/* Integrates `y` over `span_s` with the inputs held. `step_s` keeps the length of the step from call to call; 0 begins anew.
   Returns 0, or 1 where no step of sensible length meets the tolerance. */
int integrate(double *r, const int *switches, double *y, double span_s, double tolerance, double *step_s);

#endif
