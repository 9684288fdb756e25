CREATE TABLE night (
  id          INTEGER PRIMARY KEY,
  name        TEXT NOT NULL,
  started_ms  INTEGER NOT NULL,
  duration_s  REAL NOT NULL,
  program     TEXT NOT NULL,
  accepted    INTEGER NOT NULL,  -- 1: begins a new band
  moved       INTEGER NOT NULL   -- 1: a figure left its band; such a night is no part of later bands
) STRICT;
CREATE INDEX night_by_time ON night (started_ms);
CREATE TABLE run (
  id               INTEGER PRIMARY KEY,
  night_id         INTEGER NOT NULL REFERENCES night (id),
  campaign         TEXT NOT NULL,
  machine          TEXT NOT NULL,
  method           TEXT NOT NULL,
  seed             INTEGER NOT NULL,
  campaign_sha256  TEXT NOT NULL,
  model_sha256     TEXT NOT NULL,
  failure          TEXT,
  good_points REAL, eta_mean REAL, eta_true_mean REAL, eta_median_error REAL, eta_worst_error REAL, eta_coverage REAL,
  h_mean REAL, h_true_mean REAL, h_median_error REAL, h_worst_error REAL, rig_minutes REAL,
  UNIQUE (night_id, campaign, machine, method, seed)
) STRICT;
CREATE TABLE point (
  run_id               INTEGER NOT NULL REFERENCES run (id),
  speed_rpm            REAL NOT NULL,
  valve_opening_ratio  REAL NOT NULL,
  visit                INTEGER NOT NULL,
  eta REAL, eta_true REAL, h_w_m2k REAL, h_true_w_m2k REAL,
  PRIMARY KEY (run_id, speed_rpm, valve_opening_ratio, visit)
) STRICT, WITHOUT ROWID;
