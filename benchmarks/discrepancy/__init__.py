"""Hidden effects: logs with a known truth, and a score of the effects that are named in them.

Two worlds: `effect_plant` is a vehicle written from formulas alone, `multibody` a car of another
author. `catalogue` draws sets of stops, `identifiability` states what each can show, `blind_run`
hands the log alone to the workflow, `score` compares its finding with the truth.
"""
