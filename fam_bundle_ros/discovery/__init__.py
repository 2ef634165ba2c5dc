from fam_bundle_ros.data.reading import read_measurement
