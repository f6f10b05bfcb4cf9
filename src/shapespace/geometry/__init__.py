"""Axisymmetric curves and surfaces: curvature, motion, measures, parameterizations. No material constants, no grid."""
