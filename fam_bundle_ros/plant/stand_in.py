"""Today's Bundle behind the seam, until branch a lands."""
import numpy as np
from fam_bundle_ros.errors import InputError
from fam_bundle_ros.model.seam import Model


class _Plant:
    def __init__(self, bundle):
        self.bundle, self.n = bundle, bundle.n
        self.length = float(bundle.motor_units[0].geometry.length)
        self.max_pressure = bundle.max_pressure
        self.names = [u.name for u in bundle.motor_units]
        leak = droop = 0.0
        for e in bundle.pneumatics:
            if e.name == 'leak':
                leak += 1.0 / e.values['time_constant']
            else:
                droop += e.values['resistance']
        from fam_bundle_ros.plant.foreign import Pneumatics
        self.pneumatics = Pneumatics (leak, droop)
        self.readings = bundle.readings

    def model(self, compiled):
        bundle, states, cache = self.bundle, {}, {}

        def force(unit, strain, rate, pressure, time, dt, start, shape, parameters, tables,
                  memory, after):
            if unit == 0:
                token = memory[0][0]
                state = bundle.start_state() if start else states[token]
                if not start:
                    state = {**state, 'time': time - dt}
                f, new = bundle.step(state, dt, strain, np.array(pressure), rate)
                keep = token + 1 if not start else 1.0
                for key in list(states):
                    if key not in (token, keep):
                        del states[key]
                states[keep] = new
                cache['f'], cache['keep'] = f, keep
            after[unit][0] = cache['keep']
            return float(cache['f'][unit])

        def volume(unit, strain, pressure, time, shape, parameters, tables):
            key = ('v', strain)
            if cache.get('vk') != key:
                cache['v'], cache['vk'] = bundle.gas_volume(strain), key
            return float(cache['v'][unit])

        def slope(unit, strain, pressure, time, shape, parameters, tables):
            return float(bundle.gas_volume_slope(strain)[unit])
        n = self.n
        return Model(force, volume, slope, [[0.0]] * n, [0.0], [0.0], [[0.0] for _ in range(n)],
                     [[0.0] for _ in range(n)])


def stand_in(bundle):
    return bundle if hasattr(bundle, 'model') else _Plant(bundle)
