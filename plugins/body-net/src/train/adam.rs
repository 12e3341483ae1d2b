use crate::Net;

/// Means of the gradient and of its squares fade by these parts a step.
const FADE: [f32; 2] = [0.9, 0.999];
/// A gradient longer than this is shortened.
const LONGEST: f32 = 1.0;

/// Steps of adaptive size (Kingma and Ba, ICLR 2015), with weights that shrink beside
/// them (Loshchilov and Hutter, ICLR 2019).
#[derive(Default)]
pub struct Adam {
    steps: i32,
    mean: Net,
    squares: Net,
}

impl Adam {
    /// Changes the weights against the gradient.
    pub fn step(&mut self, net: &mut Net, gradient: &Net, rate: f32, decay: f32) {
        self.steps += 1;
        let length = gradient.parts().into_iter().flatten().map(|g| g * g).sum::<f32>().sqrt();
        let scale = LONGEST / length.max(LONGEST);
        let whole = FADE.map(|fade| 1.0 - fade.powi(self.steps));
        let parts = net.parts_mut().into_iter().zip(gradient.parts());
        let moments = self.mean.parts_mut().into_iter().zip(self.squares.parts_mut());
        for ((values, slopes), (means, squares)) in parts.zip(moments) {
            let numbers = values.iter_mut().zip(slopes).zip(means.iter_mut().zip(squares));
            for ((value, slope), (mean, square)) in numbers {
                let slope = slope * scale;
                *mean = FADE[0] * *mean + (1.0 - FADE[0]) * slope;
                *square = FADE[1] * *square + (1.0 - FADE[1]) * slope * slope;
                let step = (*mean / whole[0]) / ((*square / whole[1]).sqrt() + 1e-8);
                *value -= rate * (step + decay * *value);
            }
        }
    }
}
