"""Hidden effects: logs with a known truth, and a score of the effects that are named in them.

Four worlds: `plant_world` drives a vehicle written from formulas alone, `multibody_world` a car of
another author, `engine_car` free bodies in MuJoCo, `rocking_car` a car of the vertical plane.
`blind_run` hands the log alone to the workflow, `naming_benchmark` compares its finding with the
truth.
"""
