/* Rodas5P (Steinebach, BIT 63:27, 2023) with step-size control, as the program's own integrator has it: a stiffly accurate
   Rosenbrock method of order 5, whose coefficients stand in model_data.h. */

#include "machine.h"
#include <math.h>
#include <string.h>

/* Bound on the steps of one call; far above what any sensible one needs. */
#define MOST_STEPS 1000000

static const double usual_size[STATES] = {1e4, 1e5, 3e2, 5e2, 3e2, 3e2};

/* LU with row exchange; returns 0 where the matrix is singular. */
static int factorise(double m[STATES][STATES], int *order) {
    int i, j, k;
    for (k = 0; k < STATES; k++) {
        int pivot = k;
        for (i = k + 1; i < STATES; i++) {
            if (fabs(m[i][k]) > fabs(m[pivot][k])) {
                pivot = i;
            }
        }
        if (!(fabs(m[pivot][k]) > 0.0)) {
            return 0;
        }
        order[k] = pivot;
        if (pivot != k) {
            for (j = 0; j < STATES; j++) {
                const double kept = m[k][j];
                m[k][j] = m[pivot][j];
                m[pivot][j] = kept;
            }
        }
        for (i = k + 1; i < STATES; i++) {
            m[i][k] /= m[k][k];
            for (j = k + 1; j < STATES; j++) {
                m[i][j] -= m[i][k] * m[k][j];
            }
        }
    }
    return 1;
}

static void solve(double m[STATES][STATES], const int *order, double *b) {
    int i, j;
    for (i = 0; i < STATES; i++) {
        const double kept = b[i];
        b[i] = b[order[i]];
        b[order[i]] = kept;
    }
    for (i = 0; i < STATES; i++) {
        for (j = 0; j < i; j++) {
            b[i] -= m[i][j] * b[j];
        }
    }
    for (i = STATES - 1; i >= 0; i--) {
        for (j = i + 1; j < STATES; j++) {
            b[i] -= m[i][j] * b[j];
        }
        b[i] /= m[i][i];
    }
}

static double scale(int i, double a, double b, double tolerance) {
    return tolerance * (1e-3 * usual_size[i] + fmax(fabs(a), fabs(b)));
}

/* One step of `h` from `y` into `end`; returns the error over the tolerance, infinite where the step cannot be made. */
static double try_step(double *r, const int *switches, const double *y, const double *f0, double jacobian[STATES][STATES], double h,
                       double tolerance, double *end) {
    double m[STATES][STATES], u[RODAS_STAGES][STATES], at[STATES], sum = 0.0;
    int order[STATES], stage, before, i, j;
    for (i = 0; i < STATES; i++) {
        for (j = 0; j < STATES; j++) {
            m[i][j] = (i == j ? 1.0 / (h * rodas_gamma) : 0.0) - jacobian[i][j];
        }
    }
    if (!factorise(m, order)) {
        return INFINITY;
    }
    memcpy(at, y, sizeof at);
    for (stage = 0; stage < RODAS_STAGES; stage++) {
        if (stage == 0) {
            memcpy(u[0], f0, sizeof u[0]);
        } else {
            memcpy(at, y, sizeof at);
            for (before = 0; before < stage; before++) {
                for (i = 0; i < STATES; i++) {
                    at[i] += rodas_a[stage][before] * u[before][i];
                }
            }
            machine_at(r, switches, at, u[stage]);
        }
        for (before = 0; before < stage; before++) {
            for (i = 0; i < STATES; i++) {
                u[stage][i] += rodas_c[stage][before] / h * u[before][i];
            }
        }
        solve(m, order, u[stage]);
        for (i = 0; i < STATES; i++) {
            if (!isfinite(u[stage][i])) {
                return INFINITY;
            }
        }
    }
    /* Stiffly accurate: the last stage's increment ends the step, and is the estimate of its error. */
    for (i = 0; i < STATES; i++) {
        const double increment = u[RODAS_STAGES - 1][i];
        double error;
        end[i] = at[i] + increment;
        error = increment / scale(i, y[i], end[i], tolerance);
        sum += error * error;
    }
    return sqrt(sum / STATES);
}

static double first_step(const double *y, const double *f, double tolerance) {
    double norm = 1e-12;
    int i;
    for (i = 0; i < STATES; i++) {
        norm = fmax(norm, fabs(f[i]) / scale(i, y[i], y[i], tolerance));
    }
    return fmin(fmax(fmin(1e4, 1e-2 / tolerance) / norm, 1e-6), 1.0);
}

int integrate(double *r, const int *switches, double *y, double span_s, double tolerance, double *step_s) {
    double done_s = 0.0;
    int steps;
    for (steps = 0; done_s < span_s; steps++) {
        double f0[STATES], jacobian[STATES][STATES], moved[STATES], f[STATES], end[STATES], h;
        int i, j, rejected = 0;
        if (steps >= MOST_STEPS) {
            return 1;
        }
        machine_at(r, switches, y, f0);
        memcpy(moved, y, sizeof moved);
        for (j = 0; j < STATES; j++) {
            moved[j] = y[j] + 1.5e-8 * fmax(fabs(y[j]), 1e-3);
            machine_at(r, switches, moved, f);
            for (i = 0; i < STATES; i++) {
                jacobian[i][j] = (f[i] - f0[i]) / (moved[j] - y[j]);
            }
            moved[j] = y[j];
        }
        h = *step_s > 0.0 ? *step_s : first_step(y, f0, tolerance);
        for (;;) {
            const double left_s = span_s - done_s;
            const int ends_here = h >= left_s * (1.0 - 1e-9);
            const double tried_s = ends_here ? left_s : h > 0.5 * left_s ? 0.5 * left_s : h;
            const double error = try_step(r, switches, y, f0, jacobian, tried_s, tolerance, end);
            if (error <= 1.0) {
                double factor = fmin(fmax(0.9 * pow(fmax(error, 1e-10), -0.2), 0.2), 6.0);
                double proposed_s = tried_s * (rejected ? fmin(factor, 1.0) : factor);
                /* A step cut short by the end says little about how long it might have been. */
                *step_s = tried_s < h ? fmax(proposed_s, h) : proposed_s;
                memcpy(y, end, sizeof end);
                done_s = ends_here ? span_s : done_s + tried_s;
                break;
            }
            rejected = 1;
            h = tried_s * (isfinite(error) ? fmin(fmax(0.9 * pow(error, -0.2), 0.1), 0.9) : 0.1);
            if (h < 1e-14 * fmax(span_s, 1.0)) {
                return 1;
            }
        }
    }
    return 0;
}
