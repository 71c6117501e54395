"""Ports at sensors that the tuning found elsewhere than drawn are said, with the distance."""

import json

from tuning.files.plant_findings import PlantFindings


def test_sensors_off_the_drawing_are_named_with_millimetres_and_degrees(tmp_path):
    values = {
        "acc7.position_x": 1.2e-3,
        "acc7.position_y": -0.5e-3,
        "acc7.rotation_z": 0.02,
        "acc8.position_x": 1e-9,
    }
    file = tmp_path / "tuned.json"
    rows = [{"name": name, "tuned": value} for name, value in values.items()]
    file.write_text(json.dumps({"parameters": rows}), encoding="utf-8")
    findings = PlantFindings.beside(tmp_path / "tuned.xml")
    remark = findings.moved_sensor_remark(["acc7", "acc7", "acc8", "motor"])
    assert "acc7 (1.3 mm, 1.1 degrees)" in remark
    assert "acc8" not in remark
    assert findings.moved_sensor_remark(["motor"]) == ""
    assert PlantFindings.beside(tmp_path / "none.xml").moved_sensor_remark(["acc7"]) == ""
