"""The plant in CasADi: start values, derivatives, and a simulation with CVODES."""

import casadi as ca

dae = ca.DaeBuilder("plant", "target/both/BoostPlant.fmu")
dae.set("engine_speed", 2000.0)
dae.set("hp_wastegate_pwm", 44.0)  # a discrete input: a constant in CasADi

model = dae.create("model", ["x", "u"], ["ode"])
x, u = dae.get(dae.x()), dae.get(dae.u())  # settled at these inputs
boost = dae.x().index("intercooler.outlet_pressure")
print(f"settled at {x[boost] / 1e3:.2f} kPa")

by_state, by_input = model.jacobian()(x, u, 0)
weights = ca.DM.zeros(len(x))
weights[boost] = 1
by_reverse = model.reverse(1)(x, u, 0, weights)[0]  # adjoint
print(
    f"boost by itself: {float(by_state[boost, boost]):.2f} 1/s; adjoint: {float(by_reverse[boost]):.2f} 1/s"
)

system = dae.create()  # for CasADi's integrators
simulate = ca.integrator("simulate", "cvodes", system, 0.0, [1.0, 2.0])
u[dae.u().index("engine_speed")] = 2200.0
after = simulate(x0=x, u=u)["xf"].full()[boost] / 1e3
print(f"at 2200 rpm: {after[0]:.2f} kPa after 1 s, {after[1]:.2f} kPa after 2 s")
