PRAGMA application_id = 1196444754;
PRAGMA user_version = 2;
BEGIN TRANSACTION;
CREATE TABLE calibrations (
        id TEXT PRIMARY KEY,
        serial TEXT NOT NULL REFERENCES sensors (serial),
        first_seen TEXT NOT NULL,
        model TEXT NOT NULL DEFAULT '',
        made TEXT NOT NULL DEFAULT '',
        verdict TEXT NOT NULL DEFAULT ''
    );
INSERT INTO "calibrations" VALUES('c1','A-1','2026-11-20T09:30:00.000000+00:00','full','2026-11-19','pass');
INSERT INTO "calibrations" VALUES('c2','A-1','2026-11-20T09:30:00.000000+00:00','','','');
CREATE TABLE measurements (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        time TEXT NOT NULL,
        serial TEXT NOT NULL REFERENCES sensors (serial),
        calibration_id TEXT REFERENCES calibrations (id),
        shape TEXT NOT NULL,
        verdict TEXT NOT NULL,
        reason TEXT NOT NULL,
        settings TEXT NOT NULL,
        details TEXT NOT NULL,
        operator TEXT NOT NULL,
        picture TEXT NOT NULL,
        note TEXT NOT NULL,
        removed TEXT
    );
INSERT INTO "measurements" VALUES(1,'2026-11-20T09:30:00.000000+00:00','A-1','c1','cylinder','pass','','{"model": "full"}','{"yaw_deg": null, "centre_mm": [1.25, -0.5]}','Zoë','pin.png','first
press',NULL);
INSERT INTO "measurements" VALUES(2,'2026-11-20T10:30:00.000000+00:00','A-1','c1','cylinder','','','{}','{}','','','by mistake','2026-11-20T12:00:00.000000+00:00');
INSERT INTO "measurements" VALUES(3,'2026-11-20T08:30:00.000000+00:00','B-2',NULL,'ball','doubtful','{"text": "{share:.0%} of the map is missing", "values": {"share": 0.25}}','{}','{}','','','',NULL);
INSERT INTO "measurements" VALUES(4,'2026-11-20T11:30:00.000000+00:00','A-1','c2','evaluation','fail','','{"limits_percent": {"planar": 5.0, "depth": 8.0}}','{"groups": [{"name": "cylinder", "count": 3}]}','','run','',NULL);
CREATE TABLE quantities (
        measurement_id INTEGER NOT NULL REFERENCES measurements (id),
        position INTEGER NOT NULL,
        name TEXT NOT NULL,
        value REAL NOT NULL,
        sd REAL,
        truth REAL,
        error REAL,
        error_percent REAL,
        limit_percent REAL, truth_sd REAL,
        PRIMARY KEY (measurement_id, name)
    );
INSERT INTO "quantities" VALUES(1,0,'diameter_mm',5.05,0.01,5.0,4.99999999999998223643e-02,1.00000000000000088817e+00,5.0,0.002);
INSERT INTO "quantities" VALUES(1,1,'height_mm',0.97,NULL,1.0,-3.00000000000000266453e-02,-3.00000000000000266453e+00,8.0,NULL);
INSERT INTO "quantities" VALUES(2,0,'diameter_mm',5.05,0.01,5.0,4.99999999999998223643e-02,1.00000000000000088817e+00,5.0,0.002);
INSERT INTO "quantities" VALUES(2,1,'height_mm',0.97,NULL,1.0,-3.00000000000000266453e-02,-3.00000000000000266453e+00,8.0,NULL);
INSERT INTO "quantities" VALUES(3,0,'diameter_mm',3.0,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "quantities" VALUES(4,0,'planar_error_percent',3.5,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO "quantities" VALUES(4,1,'depth_error_percent',6.25,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE sensors (
        serial TEXT PRIMARY KEY,
        first_seen TEXT NOT NULL
    );
INSERT INTO "sensors" VALUES('A-1','2026-11-20T09:30:00.000000+00:00');
INSERT INTO "sensors" VALUES('B-2','2026-11-20T09:30:00.000000+00:00');
CREATE INDEX measurements_by_sensor ON measurements (serial, time);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('measurements',4);
COMMIT;
