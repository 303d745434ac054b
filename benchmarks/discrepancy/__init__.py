"""Worlds in which an effect is hidden, and a scorer of what is said about them.

`plant` is a vehicle written from the formulas alone, `engine` one of a physics engine, `multibody`
a car of somebody else's;
`catalogue` says which sets of stops there are, `worth` what can be known from each at all,
`sealed` lets the workflow see the log and nothing else, `score` compares afterwards.
"""
