/* The compressor map: the closed form of the nominal machine, or a table of speed lines. */

#include "machine.h"
#include <math.h>

static double largest(double a, double b) { return a > b ? a : b; }

#ifdef MAP_CLOSED_FORM

MapPoint map_at(double wheel_diameter_m, double speed_rpm, double pressure_ratio, double flow_scale) {
    /* Compressors with another wheel are geometrically similar to turbo_a, whose wheel has 52 mm. */
    const double wheel_ratio = wheel_diameter_m / 52e-3;
    const double area_ratio = wheel_ratio * wheel_ratio;
    const double n = wheel_ratio * speed_rpm / 1e5;
    const double tip_m_s = PI * wheel_diameter_m * speed_rpm / 60.0;
    const double work = 1.0 + 1.06 * tip_m_s * tip_m_s / (2.0 * 1005.0 * MAP_T_REF_K);
    const double surge_pr = work * work * work * sqrt(work);
    const double surge_kg_s = area_ratio * (0.0265 * pow(n, 1.35));
    const double choke_pr = 1.0 + 0.15 * (surge_pr - 1.0);
    const double choke_kg_s = area_ratio * (0.052 + 0.058 * n * sqrt(sqrt(n)));
    const double span_kg_s = choke_kg_s - surge_kg_s;
    const double x = (pressure_ratio - choke_pr) / (surge_pr - choke_pr);
    const double fast = largest(n - 1.2, 0.0);
    const double peak = 0.74 - 0.07 * (n - 1.05) * (n - 1.05) - 0.10 * fast * fast;
    MapPoint point;
    double away;
    if (x <= 0.0) {
        point.flow_kg_s = choke_kg_s;
    } else if (x < 1.0) {
        point.flow_kg_s = surge_kg_s + span_kg_s * sqrt(1.0 - pow(x, 2.2));
    } else {
        point.flow_kg_s = surge_kg_s - 2.0 * surge_kg_s * (x - 1.0);
    }
    point.flow_kg_s *= flow_scale;
    away = (point.flow_kg_s - (surge_kg_s + 0.42 * span_kg_s)) / span_kg_s;
    point.efficiency = largest(peak * (1.0 - 0.9 * away * away), 0.2);
    point.surge_position = x;
    return point;
}

#else

/* (gamma - 1)/gamma of cold air: heads of the similarity between lines. */
#define KAPPA (1.0 - 1.0 / GAMMA_AIR)

static double head(double pressure_ratio) { return pow(pressure_ratio, KAPPA) - 1.0; }

/* Place between two speed lines; beyond the outermost, one line scaled by similarity. */
typedef struct {
    int low, high;
    double share, ratio;
} Between;

static Between between_lines(double speed_rpm) {
    const int last = MAP_LINES - 1;
    Between place;
    int after = 0;
    double span_rpm, held;
    while (after <= last && map_speed_rpm[after] <= speed_rpm) {
        after++;
    }
    place.low = after == 0 ? 0 : after > last ? last : after - 1;
    place.high = after > last ? last : after;
    span_rpm = map_speed_rpm[place.high] - map_speed_rpm[place.low];
    place.share = span_rpm > 0.0 ? (speed_rpm - map_speed_rpm[place.low]) / span_rpm : 0.0;
    held = speed_rpm < map_speed_rpm[0] ? map_speed_rpm[0] : speed_rpm > map_speed_rpm[last] ? map_speed_rpm[last] : speed_rpm;
    place.ratio = speed_rpm / held;
    return place;
}

static double end_pr(Between place, const double *ends) {
    const double a = head(ends[place.low]), b = head(ends[place.high]);
    const double scaled = (a + (b - a) * place.share) * place.ratio * place.ratio;
    return pow(1.0 + largest(scaled, 0.0), 1.0 / KAPPA);
}

/* Linear between the nodes of a line, held beyond both ends. */
static double on_line(int line, double x, const double *values) {
    const int first = map_first_node[line], end = map_first_node[line + 1];
    int node = first + 1;
    double share;
    while (node < end - 1 && map_x[node] <= x) {
        node++;
    }
    share = (x - map_x[node - 1]) / (map_x[node] - map_x[node - 1]);
    share = share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share;
    return values[node - 1] + (values[node] - values[node - 1]) * share;
}

static double blended(Between place, double x, const double *values) {
    const double a = on_line(place.low, x, values), b = on_line(place.high, x, values);
    return a + (b - a) * place.share;
}

static MapPoint unscaled(double speed_rpm, double pressure_ratio) {
    const Between place = between_lines(speed_rpm);
    const double choke_pr = end_pr(place, map_choke_pr), surge_pr = end_pr(place, map_surge_pr);
    const double x = (pressure_ratio - choke_pr) / (surge_pr - choke_pr);
    MapPoint point;
    point.flow_kg_s = blended(place, x, map_flow_kg_s) * place.ratio * (1.0 - 2.0 * largest(x - 1.0, 0.0));
    point.efficiency = largest(blended(place, x, map_efficiency), 0.2);
    point.surge_position = x;
    return point;
}

MapPoint map_at(double wheel_diameter_m, double speed_rpm, double pressure_ratio, double flow_scale) {
    MapPoint point = unscaled(speed_rpm, pressure_ratio);
    (void)wheel_diameter_m;
    if (flow_scale != 1.0) {
        /* The efficiency moves along the speed line's own slope. */
        const double beside = 0.01 * largest(fabs(pressure_ratio - 1.0), 0.01);
        const MapPoint low = unscaled(speed_rpm, pressure_ratio - beside), high = unscaled(speed_rpm, pressure_ratio + beside);
        const double between_kg_s = high.flow_kg_s - low.flow_kg_s;
        const double slope = fabs(between_kg_s) > 1e-9 ? (high.efficiency - low.efficiency) / between_kg_s : 0.0;
        const double moved = point.efficiency + slope * (flow_scale - 1.0) * point.flow_kg_s;
        point.flow_kg_s *= flow_scale;
        point.efficiency = moved < 0.5 * point.efficiency ? 0.5 * point.efficiency
                         : moved > 1.5 * point.efficiency ? 1.5 * point.efficiency
                                                          : moved;
    }
    return point;
}

#endif
