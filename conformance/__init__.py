"""Holds any stepper to the certified answers and exact properties of moving walls."""
