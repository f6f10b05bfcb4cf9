! Stationary closed surfaces of guided division for AUTO-07p: the equations of ../peer_solve_bvp.py at rest.
!
! u(1..11) = r, z, psi, m, alpha, beta, v_u, n, c, j, V as there; u(12) is the mesh coordinate, since AUTO's
! right-hand sides are autonomous. par: 1 ring amplitude Delta_c, 2 meridian length h, 3 pressure p, 4 swimming speed v0.
! At rest r_t = c_t = 0 and z_t = v0, so that v_n = v0 cos(psi) and q^u = (v_u + v0 sin(psi))/h.
! beta(0) = beta(1) = 0 depend on each other at rest: v0 takes up the slack, z(0) + z(1) = 0 fixes the frame.
! Gauss points never meet the poles r = 0, so these need no hole. Units: kappa = eta_b = R0 = D = 1.

module guided_division
  implicit none
  double precision, parameter :: pi = 3.14159265358979323846d0
  double precision, parameter :: eta_s = 1d0, friction = 0.09d0, tension = 9d0, active_tension = 450d0
  double precision, parameter :: saturation = 10d0, turnover = 45d0, reference = 1d0, width_squared = 0.02d0
contains
  double precision function isotropic_tension(c)
    double precision, intent(in) :: c
    isotropic_tension = tension + active_tension*c**2/(c**2 + saturation**2)
  end function
end module

subroutine func(ndim, u, icp, par, ijac, f, dfdu, dfdp)
  use guided_division
  implicit none
  integer, intent(in) :: ndim, icp(*), ijac
  double precision, intent(in) :: u(ndim), par(*)
  double precision, intent(out) :: f(ndim)
  double precision, intent(inout) :: dfdu(ndim, ndim), dfdp(ndim, *)
  double precision :: r, m, alpha, beta, v, c, h, v0, sine, cosine, c_phi, c_u, v_n, isotropic
  double precision :: t_u, t_phi, s_u, s_phi, divergence, normal, dc, wanted

  r = u(1); m = u(4); alpha = u(5); beta = u(6); v = u(7); c = u(9)
  h = par(2); v0 = par(4)
  sine = sin(u(3)); cosine = cos(u(3))
  c_phi = sine/r
  c_u = m/r - c_phi
  v_n = cosine*v0
  isotropic = isotropic_tension(c)
  t_u = u(8)/r
  s_phi = (cosine*v + sine*v_n)/r
  s_u = (t_u - isotropic - (1d0 - eta_s)*s_phi)/(1d0 + eta_s)
  divergence = s_u + s_phi
  t_phi = isotropic + divergence - eta_s*(s_u - s_phi)
  normal = r*h*(t_u*c_u + t_phi*c_phi - par(3))
  dc = h*u(10)/r
  wanted = reference*(1d0 + par(1)*exp(-(u(12) - 0.5d0)**2/width_squared))

  f(1) = h*cosine
  f(2) = -h*sine
  f(3) = h*c_u
  f(4) = h*(m*cosine/r + alpha*sine + beta*cosine)
  f(5) = normal*sine + 0.5d0*h*(c_u**2 - c_phi**2)
  f(6) = normal*cosine
  f(7) = h*(s_u - c_u*v_n)
  f(8) = h*(cosine*t_phi + friction*r*v)
  f(9) = dc
  f(10) = r*h*((v + sine*v0)/h*dc + c*divergence + turnover*(c - wanted))
  f(11) = pi*r**2*h*sine
  f(12) = 1d0
end subroutine

subroutine stpnt(ndim, u, par, t)
  use guided_division
  implicit none
  integer, intent(in) :: ndim
  double precision, intent(inout) :: u(ndim), par(*)
  double precision, intent(in) :: t
  double precision :: sine, cosine, isotropic

  ! The unit sphere at rest with c = c0: an exact solution without a ring.
  isotropic = isotropic_tension(reference)
  par(1:4) = (/0d0, pi, 2d0*isotropic, 0d0/)
  sine = sin(pi*t); cosine = cos(pi*t)
  u(1:4) = (/sine, cosine, pi*t, 2d0*sine/)
  u(5:7) = 0d0
  u(8:10) = (/isotropic*sine, reference, 0d0/)
  u(11) = pi*(2d0/3d0 - cosine + cosine**3/3d0)
  u(12) = t
end subroutine

subroutine bcnd(ndim, par, icp, nbc, u0, u1, fb, ijac, dbc)
  use guided_division
  implicit none
  integer, intent(in) :: ndim, icp(*), nbc, ijac
  double precision, intent(in) :: par(*), u0(ndim), u1(ndim)
  double precision, intent(out) :: fb(nbc)
  double precision, intent(inout) :: dbc(nbc, *)

  fb(1:2) = (/u0(1), u1(1)/)
  fb(3:4) = (/u0(3), u1(3) - pi/)
  fb(5:6) = (/u0(6), u1(6)/)
  fb(7:8) = (/u0(7), u1(7)/)
  fb(9:10) = (/u0(10), u1(10)/)
  fb(11:12) = (/u0(11), u1(11) - 4d0*pi/3d0/)
  fb(13) = u0(5)
  fb(14) = u0(2) + u1(2)
  fb(15) = u0(12)
end subroutine

subroutine icnd(ndim, par, icp, nint, u, uold, udot, upold, fi, ijac, dint)
end subroutine

subroutine fopt(ndim, u, icp, par, ijac, fs, dfdu, dfdp)
end subroutine

subroutine pvls(ndim, u, par)
end subroutine
